"""What there is to say of a track beyond its name and shape. No Django."""

from __future__ import annotations

from paddock.errors.reasons import gettext_noop

_ = gettext_noop

DESCRIPTIONS: dict[str, str] = {
    "baja-turnpike": _(
        "Short and angular: full throttle down one long straight into a harsh hairpin, "
        "then tight 90-degree turns all the way home."
    ),
    "baja-highway": _(
        "The turnpike extended: a second massive straight, another hairpin, a turn of increasing radius "
        "and tight cutbacks."
    ),
    "kuei-raceway": _(
        "Fast: two straights between two hairpins, then a chicane into a cutback hairpin and a sweeping run home."
    ),
    "kuei-super-raceway": _(
        "The raceway extended: after the hairpins a long straight and a technical section of four double apexes."
    ),
    "cosmic-loop": _("One sprint straight, several 90-degree turns and two hairpins."),
    "cosmic-circuit": _("Several 90-degree turns joined by bends: there is no true straight, so the car never rests."),
    "straight-track": _(
        "The one track that ends: straight on from start to finish, and each lap from the start again."
    ),
    "oval": _("Two straights and two wide bends: the place for a first lap."),
}

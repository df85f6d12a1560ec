"""What there is to say of a track beyond its name and shape. No Django."""

from __future__ import annotations

from paddock.errors.reasons import gettext_noop

_ = gettext_noop

DESCRIPTIONS: dict[str, str] = {
    "baja-turnpike": _(
        "Short and angular: one long full-throttle straight into a sharp hairpin, then tight "
        "90-degree turns to the finish."
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
    "cosmic-circuit": _("Several 90-degree turns joined by bends, without a true straight."),
    "straight-track": _("The only open track: straight from start to finish. Each lap begins at the start."),
    "oval": _("Two straights and two wide bends, for a first lap."),
}

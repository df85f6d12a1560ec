"""Losses in words."""

from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from paddock.analysis.losses import Loss, Mistake

REASONS = {
    Mistake.LEFT_ROAD: gettext_lazy("left the road"),
    Mistake.CRASHED: gettext_lazy("crashed"),
    Mistake.STOPPED: gettext_lazy("stopped or turned round"),
    Mistake.ENTERED_WIDE: gettext_lazy("entered %s m wide"),
    Mistake.ENTERED_TIGHT: gettext_lazy("entered %s m tight"),
    Mistake.BRAKED_EARLY: gettext_lazy("braked %s m early"),
    Mistake.TURNED_LATE: gettext_lazy("turned in %s m late"),
    Mistake.TURNED_EARLY: gettext_lazy("turned in %s m early"),
    Mistake.BRAKED_TOO_MUCH: gettext_lazy("braked %s m/s too much"),
    Mistake.RAN_WIDE: gettext_lazy("ran %s m wide"),
    Mistake.ACCELERATED_LATE: gettext_lazy("accelerated %s m late"),
    Mistake.SLOWER: gettext_lazy("drove %s m/s slower"),
    Mistake.LONGER: gettext_lazy("drove %s m farther"),
}
_FINE = (Mistake.SLOWER, Mistake.LONGER)  # their values are small


def loss_sentence(loss: Loss) -> str:
    """Such as "0.82 s lost in turn 4: entered 0.3 m wide, braked 0.4 m/s too much"."""
    stretch, reasons = loss.stretch, []
    for mistake, value in loss.reasons:
        text = str(REASONS[mistake])
        reasons.append(text % f"{value:.{2 if mistake in _FINE else 1}f}" if "%s" in text else text)
    values = {"time": f"{loss.ms / 1000:.2f}", "turn": stretch.after, "reasons": ", ".join(reasons)}
    if stretch.turn is not None:
        return _("%(time)s s lost in turn %(turn)s: %(reasons)s") % (values | {"turn": stretch.turn.number})
    if stretch.after:
        return _("%(time)s s lost on the straight after turn %(turn)s: %(reasons)s") % values
    return _("%(time)s s lost on the straight: %(reasons)s") % values

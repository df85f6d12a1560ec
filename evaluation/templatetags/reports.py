"""What pages say of reports."""

from django import template
from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop

from evaluation.reports.grading import Grade, KindSummary

register = template.Library()

KIND_WORDS = {
    "": gettext_noop("All variations"),
    "start": gettext_noop("Start"),
    "light": gettext_noop("Light"),
    "colours": gettext_noop("Colours"),
    "sensors": gettext_noop("Sensor noise"),
    "all": gettext_noop("All at once"),
}


@register.filter
def kind_name(kind: str) -> str:
    """A kind of variation in the reader's language; ``""`` is all of them."""
    return _(KIND_WORDS[kind])


@register.filter
def spread(summary: KindSummary) -> str:
    """The spread of completed laps as a percentage; a dash where none is."""
    return "–" if summary.spread_permille is None else f"{summary.spread_permille / 10:.1f} %"


@register.filter
def asks_for(grade: Grade) -> str:
    if grade.most is not None:
        values = {"least": grade.least, "most": grade.most // 10}
        return _("at least %(least)s %% completed, a spread of at most %(most)s %%") % values
    return _("at least %(least)s %% completed") % {"least": grade.least} if grade.least else _("less")


@register.filter
def signed_gap(milliseconds: int) -> str:
    """By how much a lap was slower, with its sign."""
    return f"{'−' if milliseconds < 0 else '+'}{abs(milliseconds) / 1000:.3f}"


@register.filter
def reached(percent: float | None) -> str:
    return "–" if percent is None else f"{int(percent)} %"

"""Template tags for results hidden from the reader."""

from django import template
from django.template import Context

from evaluation.models import Evaluation
from races.models import Race
from races.replays.selectors import race_of
from races.spoilers.selectors import NOTHING, Spoilers, spoilers_of

register = template.Library()


def _of(context: Context) -> Spoilers:
    request = context.get("request")
    return NOTHING if request is None else spoilers_of(request)


@register.simple_tag(takes_context=True)
def results_hidden(context: Context, race: Race | None) -> bool:
    """``{% results_hidden race as hides %}``: whether the results of a race are hidden from the reader."""
    return _of(context).hides(race)


@register.simple_tag(takes_context=True)
def run_hidden(context: Context, run: Evaluation | None) -> bool:
    """The same of a run: those of the race that it was driven in, if it was."""
    spoilers = _of(context)
    return spoilers.on and run is not None and spoilers.hides(race_of(run))

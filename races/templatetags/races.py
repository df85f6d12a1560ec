"""What pages of rooms below this one show of races."""

from __future__ import annotations

from dataclasses import dataclass

from django import template
from django.template import Context
from django.utils import timezone
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop

from evaluation.models import Evaluation, TrainedModel
from races.eligibility import refusal
from races.models import Race, RaceState, Submission
from races.selectors import races_visible_to, racing_now
from races.sensors import not_offered
from tracks.models import Track

register = template.Library()

RACES_ON_A_TRACK = 20
RACES_FOR_A_MODEL = 12
RUNS_OF_A_MODEL = 50

END_REASONS = {
    "laps_done": gettext_noop("all laps driven"),
    "time_up": gettext_noop("the time limit was reached"),
    "resets_used": gettext_noop("no resets were left"),
}
LAP_STATUS = {
    "Lap complete": gettext_noop("complete"),
    "Off track": gettext_noop("off track"),
    "Crashed": gettext_noop("crashed"),
    "Immobilized": gettext_noop("stood still"),
    "Reversed": gettext_noop("drove backwards"),
    "Time Up": gettext_noop("time up"),
    "In progress": gettext_noop("unfinished"),
    "Pause": gettext_noop("unfinished"),
    "Prepare": gettext_noop("unfinished"),
}


@dataclass(frozen=True)
class RaceForModel:
    """A race that a model can be sent to, and its run there if it was sent already."""

    race: Race
    sent: Submission | None


@register.simple_tag(takes_context=True)
def races_on(context: Context, track: Track) -> list[Race]:
    """The latest races on a track that the reader may see."""
    return list(races_visible_to(context["user"]).filter(track=track).order_by("-opens_at", "pk")[:RACES_ON_A_TRACK])


@register.simple_tag(takes_context=True)
def races_for(context: Context, model: TrainedModel) -> list[RaceForModel]:
    """Races that take cars of the reader now and offer the model's sensors."""
    now, reader = timezone.now(), context["user"]
    races = [
        race
        for race in racing_now(now, reader)[: 2 * RACES_FOR_A_MODEL]
        if not not_offered(model.sensors, race.sensors) and refusal(race, reader, now) is None
    ][:RACES_FOR_A_MODEL]
    sent = Submission.objects.filter(
        entry__race__in=races, entry__racer_id=model.owner_id, network_id=model.network_id, is_void=False
    ).select_related("evaluation", "entry")
    by_race = {submission.entry.race_id: submission for submission in sent}
    return [RaceForModel(race, by_race.get(race.pk)) for race in races]


@register.simple_tag
def runs_of(model: TrainedModel) -> list[Evaluation]:
    """The latest evaluations of a model."""
    related = ("track", "result", "submission__entry__race")
    return list(
        Evaluation.objects.filter(model=model).select_related(*related).order_by("-queued_at")[:RUNS_OF_A_MODEL]
    )


@register.simple_tag
def state_of(race: Race) -> RaceState:
    """The race's state now."""
    return race.state_at(timezone.now())


@register.simple_tag
def race_pill(race: Race) -> SafeString:
    """The race's state now as a pill."""
    state = race.state_at(timezone.now())
    return format_html('<span class="pill {}">{}</span>', state.value, state.label)


@register.filter
def end_reason(code: str) -> str:
    """Why a run ended, in the reader's language."""
    return _(END_REASONS[code]) if code in END_REASONS else code


@register.filter
def lap_status(status: str) -> str:
    """How a lap ended, in the reader's language."""
    return _(LAP_STATUS[status]) if status in LAP_STATUS else status

"""Planning, changing and cancelling a live event."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from django.db import transaction
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.database.locks import hold
from core.events import record
from paddock.errors import UserFault

from ...entries.selectors.visibility import can_organise
from ...entries.time_checks import moment
from ...events import LIVE_PLANNED, of_race
from ...models import (
    HEAT_CARS,
    Duel,
    DuelState,
    LiveEvent,
    LiveLog,
    LiveOrder,
    LiveSlot,
    LiveState,
    Opponents,
    Race,
)
from ...models.live import LEAST_ATTEMPT_MS, LOBBY, MOST_ATTEMPT_MS, MOST_ROUNDS
from ...rules.live_start import check_start, draw_seed, draw_start
from .event_action import acting

FARTHEST = timedelta(days=366)
PLANNABLE = (
    "starts_at",
    "time_zone",
    "rounds",
    "attempt_ms",
    "order",
    "gap_s",
    "roll_call",
    "auto_run",
    "speed_control",
    "start_m",
    "seed",
)
MOST_GAP_S = 600


@audited("live.planned", _("Live event planned"))
@transaction.atomic
def plan_live(*, race: Race, by: Racer, now: datetime, starts_at: datetime, **plan: Any) -> LiveEvent:
    """Plan a race's live event; an event cancelled before its start is planned again.

    ``plan``: any of :data:`PLANNABLE`. Raises UserFault ``race_not_yours``, ``race_cancelled``, ``race_recorded``,
    ``live_exists``, ``live_of_real_cars``, ``live_with_duels`` once they are driven, ``live_before_draw``,
    ``live_in_the_past``, ``live_too_far_ahead``, ``live_time_zone``,
    ``live_format`` with the name of what is out of its range, ``live_start``, ``track_start_fixed``,
    ``boxes_do_not_fit``. A start or a seed that is not given (or None) is drawn.
    """
    if not can_organise(by, race):
        raise UserFault("race_not_yours")
    hold(race)
    race = Race.objects.select_related("track").get(pk=race.pk)
    if race.imported_at is not None:
        raise UserFault("race_recorded")
    if race.cancelled_at is not None:
        raise UserFault("race_cancelled", reason=race.cancel_reason)
    if race.physical:
        raise UserFault("live_of_real_cars")
    if Duel.objects.filter(race=race).exclude(state=DuelState.WAITING).exists():
        raise UserFault("live_with_duels")
    check_plan({"starts_at": starts_at, **plan}, now)
    _check_draw(race, starts_at)
    plan |= _start_of(race, plan)
    event = LiveEvent.objects.filter(race=race).first()
    if event is not None and (event.state != LiveState.CANCELLED or event.begun_at is not None):
        raise UserFault("live_exists")
    if event is None:
        event = LiveEvent(race=race)
    event.state, event.planned_by, event.last_at = LiveState.PLANNED, by, now
    event.starts_at, event.lobby_opens_at = starts_at, starts_at - LOBBY
    event.ended_at, event.version = None, event.version + 1
    for name, value in plan.items():
        setattr(event, name, value)
    event.save()
    LiveLog.objects.create(event=event, at=now, by=by, action="plan", told={"starts": moment(starts_at)})
    record(LIVE_PLANNED, at=now, **of_race(race))
    return event


def change_live(*, event: LiveEvent, by: Racer, seen: int | None, now: datetime, **plan: Any) -> LiveEvent:
    """Change the plan of an event that has not begun. Raises UserFault as :func:`plan_live` and ``acting``."""
    check_plan(plan, now)
    _check_draw(event.race, plan.get("starts_at", event.starts_at))
    if "start_m" in plan or "seed" in plan:
        plan |= _start_of(event.race, {"start_m": event.start_m, "seed": event.seed, **plan})
    with acting(event, "plan", by=by, seen=seen, now=now, states=(LiveState.PLANNED,)) as act:
        for name, value in plan.items():
            setattr(act.event, name, value)
        act.event.lobby_opens_at = act.event.starts_at - LOBBY
        act.details["starts"] = moment(act.event.starts_at)
        act.final = True
    return event


def cancel_live(*, event: LiveEvent, by: Racer | None, seen: int | None, now: datetime) -> LiveEvent:
    """Call an event off before it has begun. Raises UserFault as ``acting``."""
    with acting(event, "cancel", by=by, seen=seen, now=now, states=(LiveState.PLANNED,)) as act:
        act.event.state = LiveState.CANCELLED
    return event


def set_submissions(*, event: LiveEvent, is_open: bool, by: Racer, seen: int | None, now: datetime) -> LiveEvent:
    """Let racers choose their models, or no longer. Raises UserFault as ``acting``."""
    with acting(event, "submissions", by=by, seen=seen, now=now) as act:
        act.event.submissions_open = is_open
        act.details["open"] = is_open
    return event


def set_auto_run(*, event: LiveEvent, auto_run: bool, by: Racer, seen: int | None, now: datetime) -> LiveEvent:
    """Let the event go on by itself, or by hand. Raises UserFault as ``acting``."""
    with acting(event, "auto", by=by, seen=seen, now=now) as act:
        act.event.auto_run = auto_run
        act.details["auto"] = auto_run
    return event


def check_plan(plan: Mapping[str, Any], now: datetime) -> None:
    """Refuse what makes no sense. Raises UserFault; TypeError for a name that is not planned."""
    if unknown := set(plan) - set(PLANNABLE):
        raise TypeError(f"nothing of a live event that is planned: {', '.join(sorted(unknown))}")
    if "starts_at" in plan:
        if plan["starts_at"] <= now:
            raise UserFault("live_in_the_past")
        if plan["starts_at"] > now + FARTHEST:
            raise UserFault("live_too_far_ahead", days=FARTHEST.days)
    if "time_zone" in plan:
        try:
            ZoneInfo(str(plan["time_zone"]))
        except (ZoneInfoNotFoundError, ValueError, OSError) as error:
            raise UserFault("live_time_zone", zone=str(plan["time_zone"])[:64]) from error
    ranges = {
        "rounds": (1, MOST_ROUNDS),
        "attempt_ms": (LEAST_ATTEMPT_MS, MOST_ATTEMPT_MS),
        "gap_s": (0, MOST_GAP_S),
    }
    for name, (least, most) in ranges.items():
        if name in plan and not least <= plan[name] <= most:
            raise UserFault("live_format", name=name, least=least, most=most)
    if "order" in plan and plan["order"] not in LiveOrder.values:
        raise UserFault("live_order", known=", ".join(LiveOrder.values))


def _start_of(race: Race, plan: Mapping[str, Any]) -> dict[str, object]:
    """Where the event's laps begin, and its seed: as planned, or drawn. Raises UserFault."""
    start, seed = plan.get("start_m"), plan.get("seed")
    check_start(race, start, seed)
    return {
        "start_m": draw_start(race) if start is None else start,
        "seed": draw_seed(race) if seed is None else seed,
    }


def _check_draw(race: Race, starts_at: datetime) -> None:
    """Duels are drawn when their race closes. Raises UserFault("live_before_draw") for an event before that."""
    if race.opponents == Opponents.MODELS and starts_at < race.closes_at:
        raise UserFault("live_before_draw", closes=moment(race.closes_at))


def slots_of(event: LiveEvent) -> list[LiveSlot]:
    """The running order, in order."""
    related = ("racer__entry__racer", "racer__model__owner", "evaluation")
    slots = LiveSlot.objects.filter(event=event).select_related(*related).prefetch_related(HEAT_CARS)
    return list(slots.order_by("position", "pk"))

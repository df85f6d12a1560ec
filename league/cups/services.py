"""Cups of the day: announced, opened, drawn, run and ended by the clock, each step once under the lock of its row."""

import logging
from datetime import datetime, time
from zoneinfo import ZoneInfo

from django.conf import settings
from django.db import transaction
from django.db.models import QuerySet
from django.utils.translation import gettext_noop

from accounts.models import Racer
from core.events import record
from core.streams.shared_pieces import shared_value
from evaluation.models import TrainedModel
from evaluation.selectors import can_use_model
from paddock.errors import UserFault
from races.boards.selectors.board import CLASSIFIED, board_entries
from races.entries.services.entries import give_field
from races.entries.services.submissions import submit_model
from races.errors import RaceRefused
from races.models import DuelFormat, Entry, Opponents, Race, RaceState, RaceType, RankingMethod, Submission
from races.models.sensors import OFFERABLE
from races.pages.services import close_race, create_community_race
from races.web.names import house_text
from tracks.models import Track

from ..events import CUP_OVER
from ..house_cars.services import ORGANISER, house_racer
from ..models import Cup, CupDivision, CupPlace, CupStarter
from ..stewarding.official_results import cars_on_the_way
from . import rules

logger = logging.getLogger(__name__)
NAME = house_text(gettext_noop("Cup of the day"))
NOT_DRAWN = "Not drawn into this division."
_RULES = {"laps": 3, "minimum_laps": 1, "sensors": list(OFFERABLE), "max_simulated_ms": 120_000}


def run_cups(*, now: datetime) -> int:
    """Take every step that is due. Returns how many were taken; one cup that fails does not keep the others waiting."""
    taken = 0
    if settings.CUP_TIME:
        taken += _announce(now)
    for cup in Cup.objects.filter(over_at=None).select_related("race__track"):
        try:
            taken += _go_on(cup, now)
        except Exception:  # another day's cup goes on; this one is tried again at the next turn of the clock
            logger.exception("The cup of %s cannot go on.", cup)
    return taken


@transaction.atomic
def start_always(*, racer: Racer, model: TrainedModel, now: datetime) -> CupStarter:
    """Let a car start in every cup from the next one on. Raises UserFault("model_not_yours")."""
    if not can_use_model(racer, model):
        raise UserFault("model_not_yours")
    starter, _ = CupStarter.objects.update_or_create(racer=racer, defaults={"model": model, "since": now})
    return starter


def start_no_more(*, racer: Racer) -> None:
    """Let no car of the racer start in cups by itself; one that has started drives on."""
    CupStarter.objects.filter(racer=racer).delete()


def check_cup(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse the knock-out of a cup to racers who were not drawn into it. Raises UserFault("cup_not_drawn")."""
    if race.opponents != Opponents.MODELS:
        return
    if not shared_value(("of a cup", race.pk), lambda: CupDivision.objects.filter(race=race).exists()):
        return
    if not Entry.objects.filter(race=race, racer=racer).exists():
        raise UserFault("cup_not_drawn")


def classified_entries(race: Race) -> list[Entry]:
    """The ranked entries of a race in their order, with racer and counted run."""
    ranked = board_entries(race).filter(CLASSIFIED, is_baseline=False)
    return list(ranked.select_related("racer", "best__evaluation__model__network"))


def _announce(now: datetime) -> int:
    starts = rules.next_start(time.fromisoformat(settings.CUP_TIME), ZoneInfo(settings.TIME_ZONE), now)
    day = starts.astimezone(ZoneInfo(settings.TIME_ZONE)).date()
    if starts - now > rules.ANNOUNCED_BEFORE or Cup.objects.filter(day=day).exists():
        return 0
    grounds = {track.slug: track for track in Track.objects.filter(owner=None) if track.has_shape and not track.is_open}
    recent = Cup.objects.filter(day__lt=day).order_by("-day").values_list("race__track__slug", flat=True)
    try:
        slug, direction = rules.drawn_ground(day.isoformat(), list(grounds), list(recent[: rules.TRACKS_NOT_AGAIN]))
        with transaction.atomic():
            race = create_community_race(
                organiser=_organiser(now),
                now=now,
                name=f"{NAME} · {day.isoformat()}",
                track=grounds[slug],
                direction=direction,
                opens_at=starts,
                closes_at=starts + rules.QUALIFYING,
                ranking_method=RankingMethod.BEST,
                **_RULES,
            )
            _, made = Cup.objects.get_or_create(day=day, defaults={"race": race})
            if not made:
                raise _AnnouncedMeanwhile
    except _AnnouncedMeanwhile:
        return 0
    except (RaceRefused, ValueError) as problem:
        logger.warning("There is no cup of %s: %s", day, problem)
        return 0
    return 1


class _AnnouncedMeanwhile(Exception):
    """Another clock was first; the race that was made here is undone with it."""


def _organiser(now: datetime) -> Racer:
    return house_racer(name="paddock", display_name=ORGANISER, now=now)


def _go_on(cup: Cup, now: datetime) -> int:
    state = cup.race.state_at(now)
    if state == RaceState.CANCELLED:
        return int(_end(cup, now))
    if state == RaceState.OPEN:
        return _send_starters(cup, now)
    if state != RaceState.CLOSED:
        return 0
    if cup.drawn_at is None:
        return 0 if cars_on_the_way(cup.race) else int(_draw(cup, now))
    knock_outs = [one.race for one in _held(cup).select_related("race__draw")]
    for race in knock_outs:
        waiting = Submission.objects.filter(entry__race=race, evaluation__ended_at=None)
        if race.state_at(now) == RaceState.OPEN and not waiting.exists():
            close_race(race=race, now=now)
    if any(getattr(race, "draw", None) is None or race.draw.over_at is None for race in knock_outs):
        return 0
    return int(_end(cup, now))


def _held(cup: Cup) -> QuerySet[CupDivision]:
    """The divisions whose knock-out was not cancelled."""
    return cup.divisions.filter(race__cancelled_at=None)


def _send_starters(cup: Cup, now: datetime) -> int:
    """Submit the cars that start automatically, except for racers with a submission in this cup."""
    there = Submission.objects.filter(entry__race=cup.race).values("entry__racer")
    starters = CupStarter.objects.filter(racer__is_active=True).exclude(racer__in=there)
    sent = 0
    for starter in starters.select_related("racer", "model__network").order_by("since", "racer"):
        if Entry.objects.filter(race=cup.race, racer=starter.racer, withdrawn_at__isnull=False).exists():
            continue
        try:
            submit_model(race=cup.race, racer=starter.racer, model=starter.model, now=now)
            sent += 1
        except UserFault as fault:
            logger.info("The car of %s does not start in the cup of %s: %s", starter.racer, cup, fault.code)
    return sent


@transaction.atomic
def _draw(cup: Cup, now: datetime) -> bool:
    cup = Cup.objects.select_for_update(of=("self",)).select_related("race__track").get(pk=cup.pk)
    if cup.drawn_at is not None:
        return False
    ordered = classified_entries(cup.race)
    Cup.objects.filter(pk=cup.pk).update(drawn_at=now)
    for number, places in enumerate(rules.divisions(len(ordered)), start=1):
        _open_division(cup, number, [ordered[place] for place in places], now)
    if len(ordered) < 2:
        CupPlace.objects.bulk_create(
            CupPlace(cup=cup, division=1, racer=entry.racer, place=1, qualified=1) for entry in ordered
        )
        _end(cup, now)
    return True


def _open_division(cup: Cup, number: int, entries: list[Entry], now: datetime) -> None:
    qualifying = cup.race
    race = create_community_race(
        organiser=_organiser(now),
        now=now,
        name=f"{NAME} · {cup} · division {number}",
        track=qualifying.track,
        direction=qualifying.direction,
        opens_at=now,
        closes_at=now + rules.KNOCK_OUT_OPEN,
        race_type=RaceType.HEAD_TO_HEAD,
        opponents=Opponents.MODELS,
        duel_format=DuelFormat.BRACKET,
        duel_cars=2,
        ranking_method=RankingMethod.BEST,
        shared_cars=True,  # whose car it is was settled in the qualifying
        max_submissions=1,
        **_RULES,
    )
    CupDivision.objects.create(cup=cup, number=number, race=race)
    give_field(race=race, racers=[entry.racer_id for entry in entries], now=now, reason=NOT_DRAWN)
    for entry in entries:
        assert entry.best is not None, "it has a rank"
        try:
            submit_model(race=race, racer=entry.racer, model=entry.best.evaluation.model, now=now)
        except UserFault as fault:  # the car has left its garage since
            logger.info(
                "The car of %s is not in division %s of the cup of %s: %s", entry.racer, number, cup, fault.code
            )


@transaction.atomic
def _end(cup: Cup, now: datetime) -> bool:
    cup = Cup.objects.select_for_update(of=("self",)).select_related("race").get(pk=cup.pk)
    if cup.over_at is not None:
        return False
    qualified = {entry.racer_id: place for place, entry in enumerate(classified_entries(cup.race), start=1)}
    for division in _held(cup).select_related("race"):
        CupPlace.objects.bulk_create(
            CupPlace(
                cup=cup,
                division=division.number,
                racer=entry.racer,
                place=place,
                qualified=qualified.get(entry.racer_id, 1),
            )
            for place, entry in enumerate(classified_entries(division.race), start=1)
        )
    Cup.objects.filter(pk=cup.pk).update(over_at=now)
    if cup.race.cancelled_at is None:
        record(CUP_OVER, at=now, race=cup.race_id, subject=str(cup), cars=len(qualified), once=str(cup))
    return True

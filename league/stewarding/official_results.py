"""The closing of rounds, which makes results official once, and their recomputation after corrections."""

import logging
from collections.abc import Collection, Iterable
from datetime import datetime

from django.db import transaction
from django.db.models import Q, QuerySet

from accounts.models import Racer
from core.events import record, record_all, written
from paddock.errors import UserFault
from races.boards.selectors.counts import cars_waiting, driven_again
from races.entries.time_checks import moment
from races.events import RACE_OFFICIAL, of_race
from races.live.selectors.events import pending_live
from races.models import Opponents, Race, RaceState

from ..events import IN_FINALE, PROMOTED, QUALIFIED
from ..models import ChampionshipPlace, FinalePlace, Membership, Round, RoundPoints, Season
from ..standings.selectors.outcomes import BoardOutcome, outcome_of
from ..standings.services import correct_board, give_fields, pros_of

logger = logging.getLogger(__name__)
BATCH = 1000


@transaction.atomic
def close_round(*, round: Round, now: datetime) -> Round:
    """Make the results of a round official: promotions, the finale's field, qualifications and points; once only.

    Raises UserFault("round_not_over" | "round_cancelled" | "round_out_of_order" | "round_still_driving").
    """
    season = Season.objects.select_for_update().get(pk=round.season_id)
    round_ = _fresh(round, season)
    if round_.closed_at is not None:
        return round_
    _require_ready(round_, now)
    Round.objects.filter(pk=round_.pk).update(closed_at=now, held_at=None)
    round_.closed_at, round_.held_at = now, None
    _write(round_, outcome := outcome_of(round_))
    if round_.race.imported_at is None:
        _record_moves(round_, outcome, now)
        record(RACE_OFFICIAL, at=now, **of_race(round_.race), once=f"{round_.race.slug}:{now:%Y%m%d%H%M%S}")
    give_fields(season, now=now)
    return round_


def close_due_rounds(*, now: datetime, season: Season | None = None) -> list[Round]:
    """Close every due round, of one season or of all, in turn; returns those closed. Later rounds wait for earlier
    ones."""
    closed, stuck = [], set()
    for round_ in _due(now, season):
        if round_.season_id in stuck:
            continue
        try:
            closed.append(close_round(round=round_, now=now))
        except UserFault as fault:
            stuck.add(round_.season_id)
            logger.info("%s stays unofficial: %s", round_.race.slug, fault)
    return closed


@transaction.atomic
def rework(*, round: Round, now: datetime) -> None:
    """Recompute an official round, the later rounds of the season that are not final, and the season that follows."""
    season = Season.objects.select_for_update().get(pk=round.season_id)
    round_ = _fresh(round, season)
    if round_.closed_at is not None:
        closes = round_.race.closes_at
        from_here = Q(race__closes_at__gt=closes) | Q(race__closes_at=closes, pk__gte=round_.pk)
        _rework(season, _over(season, now).filter(from_here), pros_of(season.pk), now)


def _rework(season: Season, rounds: Iterable[Round], before: set[int], now: datetime) -> None:
    """``before``: the season's pros until now."""
    affected = []
    for one in rounds:
        one.season = season
        if one.closed_at is None or one.is_under_review(now):
            affected.append(one)
    official = [one for one in affected if one.closed_at is not None]
    moved = {one.pk: _moved_by(one) for one in official}
    forget_outcomes(official)
    for one in affected:
        correct_board(one, before=before, now=now)
        if one.closed_at is None:
            continue
        _write(one, outcome := outcome_of(one))
        if one.race.imported_at is None:
            _record_moves(one, outcome, now, known=moved[one.pk])
    following = Season.objects.filter(follows=season).first()
    carried = set() if following is None else pros_of(following.pk)
    give_fields(season, now=now)
    if following is not None and carried != pros_of(following.pk):
        _rework(following, _over(following, now), carried, now)


def forget_outcomes(rounds: Iterable[Round]) -> None:
    """Delete what came of these rounds; divisions that an admin gave stay."""
    ids = [one.pk for one in rounds]
    Membership.objects.filter(promoted_in__in=ids).delete()
    for model in (FinalePlace, ChampionshipPlace, RoundPoints):
        model.objects.filter(round__in=ids).delete()


def _fresh(round_: Round, season: Season) -> Round:
    fresh = Round.objects.select_related("race").get(pk=round_.pk)
    fresh.season = season
    return fresh


def _due(now: datetime, season: Season | None) -> QuerySet[Round]:
    due = Round.objects.filter(closed_at=None, held_at=None, race__cancelled_at=None, race__closes_at__lte=now)
    if season is not None:
        due = due.filter(season=season)
    return due.select_related("race", "season").order_by("race__closes_at", "pk")


def _over(season: Season, now: datetime) -> QuerySet[Round]:
    """The rounds of a season whose races are over, in the order of closing."""
    rounds = Round.objects.filter(season=season, race__cancelled_at=None)
    rounds = rounds.filter(Q(race__closes_at__lte=now) | Q(closed_at__isnull=False))
    return rounds.select_related("race").order_by("race__closes_at", "pk")


def _require_ready(round_: Round, now: datetime) -> None:
    race = round_.race
    if race.state_at(now) == RaceState.CANCELLED:
        raise UserFault("round_cancelled")
    if race.state_at(now) != RaceState.CLOSED:
        raise UserFault("round_not_over", closes=moment(race.closes_at))
    earlier = Q(race__closes_at__lt=race.closes_at) | Q(race__closes_at=race.closes_at, pk__lt=round_.pk)
    waits = Round.objects.filter(earlier, season=round_.season_id, closed_at=None, race__cancelled_at=None)
    first = waits.select_related("race").order_by("race__closes_at", "pk").first()
    if first is not None:
        raise UserFault("round_out_of_order", race=first.race.name)
    waiting = cars_on_the_way(race)
    if waiting:
        raise UserFault("round_still_driving", waiting=waiting)


def is_official(race: Race) -> bool:
    """Whether the results of a race are those of a round that was closed."""
    return Round.objects.filter(race=race, closed_at__isnull=False).exists()


def is_final(race: Race, now: datetime) -> bool:
    """Whether the results of a race are those of a round that was closed and whose steward window is over."""
    round_ = Round.objects.filter(race=race, closed_at__isnull=False).select_related("season", "race").first()
    return round_ is not None and not round_.is_under_review(now)


def cars_on_the_way(race: Race) -> int:
    """How many cars of a race still wait or drive; unfinished duels count as one, and so does a live event."""
    again = driven_again(race)  # of another engine: at least one until they all count
    left = 0 if again is None else max(1, again.runs - again.done)
    active = cars_waiting(race) + left + int(pending_live(race))
    if race.opponents != Opponents.MODELS or race.imported_at is not None:
        return active
    draw = getattr(race, "draw", None)
    return max(active, int(draw is None or draw.over_at is None))


def _moved_by(round_: Round) -> set[tuple[str, int]]:
    """Whom the round has moved on as it stands: kinds of events, with the racers."""
    promoted = Membership.objects.filter(promoted_in=round_).values_list("racer", flat=True)
    finale, qualified = (
        model.objects.filter(round=round_).values_list("racer", flat=True) for model in (FinalePlace, ChampionshipPlace)
    )
    found = ((PROMOTED, promoted), (IN_FINALE, finale), (QUALIFIED, qualified))
    return {(kind.name, racer) for kind, racers in found for racer in racers}


def _record_moves(round_: Round, outcome: BoardOutcome, now: datetime, known: Collection[tuple[str, int]] = ()) -> None:
    """Write down whom a round moves on, but for those whom it did before it was worked out anew."""
    promoted = [racer for _place, racer in outcome.promoted]
    found = ((PROMOTED, promoted), (IN_FINALE, outcome.finale), (QUALIFIED, outcome.qualified))
    season = round_.season.slug
    record_all(
        written(kind, at=now, racer=racer, race=round_.race_id, subject=season, round=round_.pk)
        for kind, racers in found
        for racer in racers
        if (kind.name, racer) not in known
    )


def _write(round_: Round, outcome: BoardOutcome) -> None:
    closed = round_.race.closes_at
    season = round_.season_id
    Membership.objects.bulk_create(
        [
            Membership(season_id=season, racer_id=racer, division="pro", since=closed, promoted_in=round_, place=place)
            for place, racer in outcome.promoted
        ],
        batch_size=BATCH,
    )
    FinalePlace.objects.bulk_create(
        [FinalePlace(round=round_, racer_id=racer, place=place) for place, racer in enumerate(outcome.finale, start=1)]
    )
    # of a later finale that is final
    kept = set(ChampionshipPlace.objects.filter(season=season).values_list("racer", flat=True))
    ChampionshipPlace.objects.bulk_create(
        [
            ChampionshipPlace(season_id=season, round=round_, racer_id=racer, place=place)
            for place, racer in enumerate(outcome.qualified, start=1)
            if racer not in kept
        ]
    )
    racers = Racer.objects.only("country", "team").in_bulk([racer for _rank, racer, _points in outcome.points])
    RoundPoints.objects.bulk_create(
        [
            RoundPoints(
                round=round_,
                racer_id=racer,
                rank=rank,
                points=points,
                country=racers[racer].country,
                team=racers[racer].team,
            )
            for rank, racer, points in outcome.points
        ]
    )

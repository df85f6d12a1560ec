"""Every write to the fields of rounds and to ratings."""

from datetime import datetime

from django.db import transaction

from races.duels.ratings import rate
from races.entries.services.entries import bring_back, give_field, take_out
from races.models import Division, DuelCompetitor, DuelState, Entry, RaceState

from ..models import DuelRating, Membership, Round, Season, Stage
from ..models.season import WITH_FIELD
from .selectors.boards import field_of

NOT_IN_FIELD = "Not in the field after the results were corrected."
NOT_PRO = "Not in the pro division after the results were corrected."


def give_round_its_field(round_: Round, *, now: datetime) -> None:
    """Enter the official field of a finale or championship that is not over and was not imported."""
    if round_.stage not in WITH_FIELD or round_.race.imported_at is not None:
        return
    give_field(race=round_.race, racers=field_of(round_) or [], now=now, reason=NOT_IN_FIELD)


def give_fields(season: Season, *, now: datetime) -> None:
    """Enter the fields of coming races, remove others than pros from pro races, and carry pros to the season that
    follows."""
    ahead = season.rounds.filter(race__closes_at__gt=now, race__cancelled_at=None, race__imported_at=None)
    for round_ in ahead.filter(stage__in=[Stage.PRO, *WITH_FIELD]).select_related("race"):
        round_.season = season
        if round_.race.state_at(now) not in (RaceState.UPCOMING, RaceState.OPEN):
            continue
        if round_.stage in WITH_FIELD:
            give_round_its_field(round_, now=now)
        else:
            _only_pros(round_, now)
    _carry_divisions(season, now)


def _carry_divisions(season: Season, now: datetime) -> None:
    """Pros of a season are pros in the season that follows, unless they have a division there already."""
    following = Season.objects.select_for_update(of=("self",)).filter(follows=season).first()
    if following is None:
        return
    pros = Membership.objects.filter(season=season, division=Division.PRO)
    own = Membership.objects.filter(season=following)
    gone, _rows = own.filter(carried=True).exclude(racer__in=pros.values("racer")).delete()
    new = [
        Membership(season=following, racer_id=racer, division=Division.PRO, since=since, carried=True)
        for racer, since in pros.exclude(racer__in=own.values("racer")).values_list("racer", "since")
    ]
    Membership.objects.bulk_create(new, batch_size=1000)
    if gone or new:
        give_fields(following, now=now)


def _only_pros(round_: Round, now: datetime) -> None:
    pros = Membership.objects.filter(season=round_.season_id, division="pro").values("racer")
    inside = Entry.objects.filter(race=round_.race, is_baseline=False).select_related("race")
    take_out(inside.filter(removed_at=None).exclude(racer__in=pros), now=now, reason=NOT_PRO)
    bring_back(inside.filter(racer__in=pros), reason=NOT_PRO)


def correct_board(round_: Round, *, before: set[int], now: datetime) -> None:
    """Remove racers whom corrected results exclude from a finished race, and restore those whom they admit again.

    ``before``: the pros until now (ids); in a pro race only the difference to them counts.
    """
    if round_.race.imported_at is not None or round_.stage not in (Stage.PRO, *WITH_FIELD):
        return
    entries = Entry.objects.filter(race=round_.race, is_baseline=False).select_related("race")
    if round_.stage in WITH_FIELD:
        may, reason = set(field_of(round_) or []), NOT_IN_FIELD
        lost = [one for one in entries if one.racer_id not in may]
    else:
        may, reason = pros_of(round_.season_id, round_.race.closes_at), NOT_PRO
        lost = [one for one in entries if one.racer_id in before - may]
        may -= before
    take_out(lost, now=now, reason=reason)
    bring_back([one for one in entries if one.racer_id in may], reason=reason)


def pros_of(season: int, until: datetime | None = None) -> set[int]:
    """Ids of the pros of a season; with ``until`` only those promoted before it."""
    pros = Membership.objects.filter(season=season, division=Division.PRO)
    if until is not None:
        pros = pros.filter(since__lt=until)
    return set(pros.values_list("racer", flat=True))


@transaction.atomic
def rate_season(*, season: Season) -> int:
    """Rate a season's racers anew from every duel driven, in a fixed order; returns how many have a rating."""
    ratings = rate(_places(season))
    DuelRating.objects.filter(season=season).delete()
    DuelRating.objects.bulk_create(
        DuelRating(season=season, racer_id=racer, mu=one.mu, sigma=one.sigma, duels=one.duels)
        for racer, one in ratings.items()
    )
    return len(ratings)


def _places(season: Season) -> list[dict[int, int]]:
    """The places by racer of each driven duel of a season, in their fixed order."""
    cars = (
        DuelCompetitor.objects.filter(
            duel__race__round__season=season,
            duel__race__draw__over_at__isnull=False,
            duel__state=DuelState.DECIDED,
            duel__evaluation__isnull=False,
            forfeited=False,
        )
        .order_by("duel__race__closes_at", "duel__race", "duel__round", "duel__number", "grid")
        .values_list("duel", "entry__racer", "place", "retired_code")
    )
    duels: dict[int, dict[int, int]] = {}
    last = 1 + max((place or 0 for _, _, place, _ in cars), default=0)
    for duel, racer, place, retired in cars:
        duels.setdefault(duel, {})[racer] = last if retired or place is None else place
    return list(duels.values())

"""Entering those, and only those, who may drive where the rules say who does."""

from __future__ import annotations

from datetime import datetime

from races.models import Division, Entry, RaceState
from races.services.entries import bring_back, give_field, take_out

from ..models import Membership, Round, Season, Stage
from ..models.season import WITH_FIELD
from ..selectors.fields import field_of

NOT_IN_FIELD = "Not in the field after the results were corrected."
NOT_PRO = "Not in the pro division after the results were corrected."


def give_round_its_field(round_: Round, *, now: datetime) -> None:
    """Enter the field of a finale or championship; nothing for other races, and for those driven elsewhere.

    A race that is over keeps its entries, and so does one whose field is not official yet.
    """
    if round_.stage not in WITH_FIELD or round_.race.imported_at is not None:
        return
    give_field(race=round_.race, racers=field_of(round_) or [], now=now, reason=NOT_IN_FIELD)


def give_fields(season: Season, *, now: datetime) -> None:
    """Enter the fields of a season's races that are not over, and see that nobody but pros is in its pro races. The
    season that follows gets the same pros, and so on."""
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
    """Who is a pro in a season is one in the season that follows, unless that has put them into a division already."""
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
    """Take those off the board of a race that is over whom the corrected results no longer let drive there, and bring
    back those whom they do: by the field of a finale or championship; in a pro race by who is a pro and was one
    ``before`` (ids), so that a division that an admin gave or took changes nothing."""
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
    """Ids of the pros of a season, of those who were promoted before ``until``."""
    pros = Membership.objects.filter(season=season, division=Division.PRO)
    if until is not None:
        pros = pros.filter(since__lt=until)
    return set(pros.values_list("racer", flat=True))

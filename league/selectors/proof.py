"""Where our rules and the record of an imported season agree."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from itertools import groupby
from operator import itemgetter
from typing import Any

from races.models import Entry, Race
from races.selectors.boards import ORDER

from ..models import ChampionshipPlace, FinalePlace, Membership, Round, Season, Stage

Pairs = tuple[int, int]


def proof_of(season: Season) -> dict[str, Any]:
    """The agreement of an imported season, as plain data.

    ``races``, ``results``, ``racers``: how many were imported. ``order``: of all pairs of results of a race whose
    recorded scores differ, those that our board has in the recorded order. ``scores``: of the results with a time,
    those whose recorded score is the time that the race is ranked by. ``promotion``: of those recorded in a pro race,
    whom our rule had promoted from an open race that closed before it opened. ``finale``: of those recorded in a
    finale, who is in the field that our rule forms of its qualifier. ``championship``: how many qualify by our rule.
    ``differences``: racers at another place than in the record, by race. ``notes``: contradictions and gaps of the
    record itself.
    """
    recorded = season.rounds.filter(race__record__isnull=False).select_related("race")
    rounds = list(recorded.order_by("race__record__position"))
    entries = Entry.objects.filter(race__round__in=rounds)
    order, timed = [0, 0], [0, 0]
    for round_ in rounds:
        results = _recorded(round_)
        for total, one in zip((order, timed), (_agreeing_pairs(results), _measured(results)), strict=True):
            total[0] += one[0]
            total[1] += one[1]
    promotion, unpromoted = _promotion(season, rounds)
    finale, outside = _finale(season, rounds)
    return {
        "season": season.slug,
        "races": len(rounds),
        "results": entries.count(),
        "racers": entries.values("racer").distinct().count(),
        "order": dict(zip(("pairs", "agree"), order, strict=True)),
        "scores": dict(zip(("checked", "agree"), timed, strict=True)),
        "promotion": dict(zip(("checked", "agree"), promotion, strict=True)),
        "finale": dict(zip(("places", "agree"), finale, strict=True)),
        "championship": ChampionshipPlace.objects.filter(season=season).count(),
        "differences": {"promotion": unpromoted, "finale": outside},
        "notes": [*_times_of_finales(rounds), *_promoted_before(season, rounds, unpromoted)],
    }


def total_proof(proofs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The sums of several seasons' agreements, and each of them under ``seasons``. Who raced in two counts twice."""
    total: dict[str, Any] = {}
    for name in ("races", "results", "racers", "order", "scores", "promotion", "finale", "championship"):
        values = [proof[name] for proof in proofs]
        if isinstance(values[0], dict):
            total[name] = {key: sum(value[key] for value in values) for key in values[0]}
        else:
            total[name] = sum(values)
    return total | {"notes": [note for proof in proofs for note in proof["notes"]], "seasons": list(proofs)}


def _recorded(round_: Round) -> list[tuple[int, int, bool, bool]]:
    """Recorded score and rank, whether the score is the time ranked by, and whether classified, in our order."""
    entries = Entry.objects.filter(race=round_.race, record__isnull=False).order_by(*ORDER)
    return list(entries.values_list("record__score", "record__rank", "record__measured", "classified"))


def _measured(recorded: Iterable[tuple[int, int, bool, bool]]) -> Pairs:
    measured = [one[2] for one in recorded if one[3]]
    return len(measured), sum(measured)


def _agreeing_pairs(recorded: Sequence[tuple[int, int, bool, bool]]) -> Pairs:
    """How many pairs have different scores, and how many of these stand in the recorded order: n log n comparisons."""
    ours = [(score, rank) for score, rank, _measured, _classified in recorded]
    pairs = _all_pairs(len(ours))
    contrary = _inversions([rank for _score, rank in ours])
    # within equal scores the record's order means nothing
    for _score, same in groupby(sorted(ours, key=itemgetter(0)), itemgetter(0)):
        ranks = [rank for _same_score, rank in same]
        pairs -= _all_pairs(len(ranks))
        contrary -= _inversions(ranks)
    return pairs, pairs - contrary


def _all_pairs(count: int) -> int:
    return count * (count - 1) // 2


def _inversions(ranks: Iterable[int]) -> int:
    """How many pairs of ``ranks`` stand in the wrong order."""
    seen: list[int] = []
    count = 0
    for rank in ranks:
        count += len(seen) - bisect_right(seen, rank)
        insort(seen, rank)
    return count


def _promotion(season: Season, rounds: Iterable[Round]) -> tuple[Pairs, list[dict[str, str]]]:
    members = Membership.objects.filter(season=season, promoted_in__isnull=False)
    since = dict(members.values_list("racer", "promoted_in__race__closes_at"))
    checked, missing = 0, []
    for round_ in rounds:
        if round_.stage != Stage.PRO:
            continue
        for racer, alias in _racers(round_):
            checked += 1
            if racer not in since or since[racer] > round_.race.opens_at:
                missing.append({"race": round_.race.slug, "racer": alias})
    return (checked, checked - len(missing)), missing


def _finale(season: Season, rounds: Iterable[Round]) -> tuple[Pairs, list[dict[str, str]]]:
    field = set(FinalePlace.objects.filter(round__season=season).values_list("round__number", "racer"))
    places, outside = 0, []
    for round_ in rounds:
        if round_.stage != Stage.FINALE:
            continue
        for racer, alias in _racers(round_):
            places += 1
            if (round_.number, racer) not in field:
                outside.append({"race": round_.race.slug, "racer": alias})
    return (places, places - len(outside)), outside


def _times_of_finales(rounds: Sequence[Round]) -> list[str]:
    """Finales whose recorded times contradict their pro race or their submissions."""
    notes = []
    pro = {round_.number: round_.race for round_ in rounds if round_.stage == Stage.PRO}
    for round_ in rounds:
        if round_.stage != Stage.FINALE:
            continue
        race, before = round_.race, pro.get(round_.number)
        if before is not None and race.closes_at < before.closes_at:
            notes.append(
                f"{race.slug}: the finale closes {_minute(race.closes_at)}, before its pro race {before.slug} closes "
                f"{_minute(before.closes_at)}."
            )
        late = Entry.objects.filter(race=race, record__isnull=False, achieved_at__gt=race.closes_at).count()
        if late:
            closes = _minute(race.closes_at)
            notes.append(f"{race.slug}: the finale closes {closes}, before the submission of {late} of its results.")
    return notes


def _minute(moment: datetime) -> str:
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC"


def _promoted_before(season: Season, rounds: Sequence[Round], unpromoted: Sequence[dict[str, str]]) -> list[str]:
    """A season that began with promoted racers: its first pro race opened before any open race of it had closed."""
    first = min((round_.race for round_ in rounds if round_.stage == Stage.PRO), key=_opens, default=None)
    if first is None or not unpromoted:
        return []
    closed = [one for one in rounds if one.stage == Stage.OPEN and one.race.closes_at <= first.opens_at]
    held = sum(one["race"] == first.slug for one in unpromoted)
    if closed or not held:
        return []
    return [
        f"{season.slug}: the season began with promoted racers: {held} raced in {first.slug} before any open race had "
        "closed. Promotions can agree only in part."
    ]


def _opens(race: Race) -> datetime:
    return race.opens_at


def _racers(round_: Round) -> list[tuple[int, str]]:
    entries = Entry.objects.filter(race=round_.race, record__isnull=False).order_by("record__rank", "pk")
    return list(entries.values_list("racer", "record__alias"))

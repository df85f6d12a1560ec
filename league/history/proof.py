"""The agreement between our rules and the record of an imported season."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime
from itertools import groupby
from operator import itemgetter
from typing import TypedDict

from races.boards.selectors.board import ORDER
from races.models import Entry

from ..models import ChampionshipPlace, FinalePlace, Membership, Round, Season, Stage

Pairs = tuple[int, int]


class Differing(TypedDict):
    """The slug of a race, and the alias of a racer at another place than in the record."""

    race: str
    racer: str


class SeasonTotals(TypedDict):
    """Counts of what was compared, and of what agrees."""

    races: int
    results: int
    racers: int
    order: dict[str, int]  # pairs of results with different recorded scores, and those in the recorded order
    scores: dict[str, int]  # results with a time, and those whose recorded score is the time ranked by
    promotion: dict[str, int]  # recorded racers of pro races, and those our rule promoted before
    finale: dict[str, int]  # recorded finalists, and those in the field by our rule
    championship: int
    notes: list[str]  # contradictions and gaps of the record


class SeasonProof(SeasonTotals):
    season: str
    differences: dict[str, list[Differing]]


class TotalProof(SeasonTotals):
    seasons: list[SeasonProof]


def proof_of(season: Season) -> SeasonProof:
    """The agreement of an imported season with our rules, as plain data."""
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


def total_proof(proofs: Sequence[SeasonProof]) -> TotalProof:
    """The sums of several agreements, and each under ``seasons``. A racer in two seasons counts twice."""
    return {
        "races": sum(proof["races"] for proof in proofs),
        "results": sum(proof["results"] for proof in proofs),
        "racers": sum(proof["racers"] for proof in proofs),
        "order": _sums(proof["order"] for proof in proofs),
        "scores": _sums(proof["scores"] for proof in proofs),
        "promotion": _sums(proof["promotion"] for proof in proofs),
        "finale": _sums(proof["finale"] for proof in proofs),
        "championship": sum(proof["championship"] for proof in proofs),
        "notes": [note for proof in proofs for note in proof["notes"]],
        "seasons": list(proofs),
    }


def _sums(counts: Iterable[dict[str, int]]) -> dict[str, int]:
    first, *others = counts
    return {key: first[key] + sum(one[key] for one in others) for key in first}


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


def _promotion(season: Season, rounds: Iterable[Round]) -> tuple[Pairs, list[Differing]]:
    members = Membership.objects.filter(season=season, promoted_in__isnull=False)
    since = dict(members.values_list("racer", "promoted_in__race__closes_at"))
    return _compared(rounds, Stage.PRO, lambda round_, racer: racer in since and since[racer] <= round_.race.opens_at)


def _finale(season: Season, rounds: Iterable[Round]) -> tuple[Pairs, list[Differing]]:
    field = set(FinalePlace.objects.filter(round__season=season).values_list("round__number", "racer"))
    return _compared(rounds, Stage.FINALE, lambda round_, racer: (round_.number, racer) in field)


def _compared(
    rounds: Iterable[Round], stage: Stage, agrees: Callable[[Round, int], bool]
) -> tuple[Pairs, list[Differing]]:
    """How many racers are recorded in rounds of a stage, how many of them agree, and the others."""
    checked = 0
    differing: list[Differing] = []
    for round_ in rounds:
        if round_.stage != stage:
            continue
        entries = Entry.objects.filter(race=round_.race, record__isnull=False).order_by("record__rank", "pk")
        for racer, alias in entries.values_list("racer", "record__alias"):
            checked += 1
            if not agrees(round_, racer):
                differing.append({"race": round_.race.slug, "racer": alias})
    return (checked, checked - len(differing)), differing


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


def _promoted_before(season: Season, rounds: Sequence[Round], unpromoted: Sequence[Differing]) -> list[str]:
    """A season that began with promoted racers: its first pro race opened before any open race of it had closed."""
    first = min(
        (round_.race for round_ in rounds if round_.stage == Stage.PRO), key=lambda race: race.opens_at, default=None
    )
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

"""The qualifying line and other facts of a season on the board of one of its races, in a few queries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, TypeAlias, TypedDict

from django.db.models import Exists, OuterRef, QuerySet

from accounts.models import Racer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from paddock.errors import UserFault
from races.boards.selectors.board import Board
from races.models import Division, Race, RaceKind

from ...models import ChampionshipPlace, FinalePlace, Membership, Round, Season, Stage, StewardDecision
from ...models.season import WITH_FIELD
from ..rules import ChampionshipField, FinaleField, Promotion
from .outcomes import classified_order, guests_in, qualified_before

if TYPE_CHECKING:
    from django_stubs_ext import WithAnnotations

    class _RoundFacts(TypedDict):
        has_decisions: bool
        reader_division: str

    ShownRound: TypeAlias = WithAnnotations[Round, _RoundFacts]


@dataclass(frozen=True)
class BoardCut:
    """The qualifying line of a board.

    ``last_rank``: the last rank above the line, 0 while nobody is classified. ``moved``: ids of the page's racers that
    the race promotes or qualifies; ``held``: ids of those above the line that already are. ``official``: whether this
    is final, or the state if the race closed now. ``sentence``: the rule.
    """

    round: Round
    last_rank: int
    sentence: str
    official: bool
    moved: frozenset[int] = field(default_factory=frozenset)
    held: frozenset[int] = field(default_factory=frozenset)


def round_of(race: Race, racer: Racer | None = None) -> ShownRound | None:
    """The round that a race is, with its season; None for all others. One query for all readers, for league races only.

    ``has_decisions``: of stewards. The race keeps what was read. With ``racer`` also ``reader_division`` ("" for none),
    by a query each time, unless :func:`read_rounds` has read it: a write decides by it.
    """
    if race.kind != RaceKind.LEAGUE:
        return None
    if not hasattr(race, "_round_shown"):
        shared = shared_value(("round", race.pk), lambda: _rounds([race.pk]).first())
        _keep_round(race, copy(shared))
    found: ShownRound | None = race._round_shown
    if found is not None and racer is not None and getattr(race, "_round_reader", None) != racer.pk:
        found = copy(found)  # other readers may share the race
        found.reader_division = next(iter(_divisions(season=found.season_id, racer=racer.pk)), "")
    return found


_divisions = KeptQuery(
    lambda season, racer: (
        Membership.objects.filter(season_id=season, racer_id=racer).order_by().values_list("division", flat=True)
    )
)


_memberships: KeptQuery[tuple[int, str]] = KeptQuery(
    lambda racer: Membership.objects.filter(racer_id=racer).order_by().values_list("season", "division")
)


def read_rounds(races: Sequence[Race], racer: Racer) -> None:
    """Read what a page asks :func:`round_of` about each of these races with ``racer``: one query of the racer's own."""
    league = [race for race in races if race.kind == RaceKind.LEAGUE]
    if not league:
        return
    pks = tuple(race.pk for race in league)
    rounds = shared_value(("rounds", pks), lambda: {round_.race_id: round_ for round_ in _rounds(pks)})
    own = dict(_memberships(racer=racer.pk))
    for race in league:
        round_ = copy(rounds.get(race.pk))
        if round_ is not None:
            round_.reader_division = own.get(round_.season_id, "")  # type: ignore[attr-defined]
        _keep_round(race, round_)
        race._round_reader = racer.pk


def _rounds(races: Sequence[int]) -> QuerySet[Round]:
    decisions = StewardDecision.objects.filter(round=OuterRef("pk"))
    return Round.objects.filter(race__in=races).select_related("season").annotate(has_decisions=Exists(decisions))


def _keep_round(race: Race, found: Round | None) -> None:
    race._round_shown = found
    if found is not None:
        found.race = race


def board_cut(round_: Round, classified: int, racers: Mapping[int, int]) -> BoardCut | None:
    """The line through the board of a round, if any. ``classified``: racers with a rank; ``racers``: ranks on the page
    by id."""
    if round_.race.cancelled_at is not None:
        return None
    if round_.stage == Stage.OPEN:
        return _promotion(round_, classified, racers)
    if round_.stage in (Stage.PRO, Stage.FINALE):
        return _field(round_)
    return None


def cut_shown(board: Board) -> BoardCut | None:
    """The season's line through a page of a board; None for other races."""
    round_ = round_of(board.race)
    if round_ is None:
        return None
    rows = [*board.rows, board.my_row] if board.my_row is not None else board.rows
    ranked = {row.entry.racer_id: row.rank for row in rows if row.rank is not None}
    return board_cut(round_, board.classified_count, ranked)


def _promotion(round_: Round, classified: int, ranks: Mapping[int, int]) -> BoardCut:
    rule, official = Promotion(round_.season.promotion_percent), round_.closed_at is not None
    last = rule.places(classified)
    racers = [racer for racer, rank in ranks.items() if rank <= last]  # racers below the line stay out
    members = Membership.objects.filter(season=round_.season_id, racer__in=racers).order_by()
    by = dict(members.values_list("racer_id", "promoted_in_id"))
    moved = frozenset(racer for racer, promoted_in in by.items() if promoted_in == round_.pk)
    held = frozenset(by) - moved
    if not official:
        moved = frozenset(racers) - held - guests_in(round_.race)
    return BoardCut(round_, last, rule.sentence(), official, moved, held)


def _field(round_: Round) -> BoardCut:
    season = round_.season
    if round_.stage == Stage.PRO:
        size, sentence = season.finale_size, FinaleField(season.finale_size).sentence()
    else:
        size, sentence = season.championship_places, ChampionshipField(season.championship_places).sentence()
    held = frozenset(qualified_before(round_))
    not_free = held | guests_in(round_.race)
    order = classified_order(round_.race, size + len(not_free))
    free = [(rank, racer) for rank, racer in enumerate(order, start=1) if racer not in not_free][:size]
    last = free[-1][0] if free else 0
    return BoardCut(
        round_, last, sentence, round_.closed_at is not None, frozenset(racer for _rank, racer in free), held
    )


def season_of(race: Race) -> Season | None:
    round_ = Round.objects.filter(race=race).select_related("season").first()
    return None if round_ is None else round_.season


def field_of(round_: Round) -> list[int] | None:
    """Ids of the racers in the field of a finale or a championship, the best placed first; None for other races."""
    if round_.stage == Stage.FINALE:
        places = FinalePlace.objects.filter(round__season=round_.season_id, round__number=round_.number)
        return list(places.order_by("place").values_list("racer", flat=True))
    if round_.stage == Stage.CHAMPIONSHIP:
        qualified = ChampionshipPlace.objects.filter(season=round_.season_id)
        return list(qualified.order_by("round__race__closes_at", "place").values_list("racer", flat=True))
    return None


def check_division(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse league races of another division, and races with a given field to racers outside it.

    Raises UserFault("race_pro_only" | "race_open_only" | "race_not_in_field").
    """
    if race.kind != RaceKind.LEAGUE or race.division == Division.ALL:
        return
    round_ = round_of(race, racer)
    division = Division.OPEN
    if round_ is not None:
        if round_.reader_division:
            division = Division(round_.reader_division)
        if round_.stage in WITH_FIELD:
            if racer.pk not in (field_of(round_) or []):
                raise UserFault("race_not_in_field")
            return
    if race.division == division:
        return
    raise UserFault("race_pro_only" if race.division == Division.PRO else "race_open_only")

"""What a season says about the board of one of its races, for the page that shows it: a few queries of fixed cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, TypeAlias, TypedDict

from django.db.models import Exists, OuterRef, QuerySet, Subquery, Value
from django.db.models.functions import Coalesce

from accounts.models import Racer
from races.models import Race, RaceKind
from races.selectors import Board

from ..models import ChampionshipPlace, Membership, Round, Stage, StewardDecision
from ..rules import ChampionshipField, FinaleField, Promotion
from .outcomes import classified_order, guests_in

if TYPE_CHECKING:
    from django_stubs_ext import WithAnnotations

    class _Said(TypedDict):
        has_decisions: bool
        reader_division: str

    ShownRound: TypeAlias = WithAnnotations[Round, _Said]


@dataclass(frozen=True)
class BoardCut:
    """The line through a board as a page draws it.

    ``last_rank``: the last rank above the line, 0 while nobody is classified. ``moved``: ids of the racers of the page
    whom the race moves on; ``held``: ids of those above the line whom it does not, since they are there already.
    ``official``: whether it is so, or would be so if the race closed now. ``sentence``: the rule.
    """

    round: Round
    last_rank: int
    sentence: str
    official: bool
    moved: frozenset[int] = field(default_factory=frozenset)
    held: frozenset[int] = field(default_factory=frozenset)


def round_of(race: Race, racer: Racer | None = None) -> ShownRound | None:
    """The round that a race is, with its season; None for all others. One query, for league races only.

    ``has_decisions``: whether stewards decided anything about it. With ``racer`` it also has ``reader_division`` (""
    for none of their own). What was read once stays with the race, for the page that shows it.
    """
    if race.kind != RaceKind.LEAGUE:
        return None
    if hasattr(race, "_round_shown") and (racer is None or getattr(race, "_round_reader", None) == racer.pk):
        return race._round_shown
    _read_rounds([race], racer)
    return race._round_shown


def read_rounds(races: Sequence[Race], racer: Racer) -> None:
    """Read the rounds of these races for a page that asks :func:`round_of` about each with ``racer``: one query."""
    _read_rounds(races, racer)
    for race in races:
        race._round_reader = racer.pk


def _read_rounds(races: Sequence[Race], racer: Racer | None) -> None:
    league = [race for race in races if race.kind == RaceKind.LEAGUE]
    rounds = Round.objects.filter(race__in=league).select_related("season")
    rounds = rounds.annotate(has_decisions=Exists(StewardDecision.objects.filter(round=OuterRef("pk"))))
    if racer is not None:
        own = Membership.objects.filter(season=OuterRef("season"), racer=racer).order_by().values("division")[:1]
        rounds = rounds.annotate(reader_division=Coalesce(Subquery(own), Value("")))
    found = {round_.race_id: round_ for round_ in rounds} if league else {}
    for race in league:
        race._round_shown = found.get(race.pk)
        if race._round_shown is not None:
            race._round_shown.race = race


def due_rounds(now: datetime) -> QuerySet[Round]:
    """Rounds that could be official but are not yet, nobody holding them back."""
    return Round.objects.filter(closed_at=None, held_at=None, race__cancelled_at=None, race__closes_at__lte=now)


def board_cut(round_: Round, classified: int, racers: Mapping[int, int]) -> BoardCut | None:
    """The line through the board of a round; None where no rule draws one, and where the race was cancelled.

    ``classified``: how many have a rank; ``racers``: ranks of those on the page by their ids. At most two queries, of
    the size of the page or of a finale, never of the board.
    """
    if round_.race.cancelled_at is not None:
        return None
    if round_.stage == Stage.OPEN:
        return _promotion(round_, classified, racers)
    if round_.stage in (Stage.PRO, Stage.FINALE):
        return _field(round_)
    return None


def cut_shown(board: Board) -> BoardCut | None:
    """The line that the season draws through a page of a board: promoted, in the finale, qualified; None for others.

    It is worked out once for a page: what was read stays with the board's race.
    """
    race = board.race
    if not hasattr(race, "_cut_shown"):
        round_ = round_of(race)
        race._cut_shown = None if round_ is None else _cut_of_page(board, round_)
    return race._cut_shown


def _cut_of_page(board: Board, round_: Round) -> BoardCut | None:
    rows = [*board.rows, board.my_row] if board.my_row is not None else board.rows
    ranked = {row.entry.racer_id: row.rank for row in rows if row.rank is not None}
    return board_cut(round_, board.classified_count, ranked)


def _promotion(round_: Round, classified: int, ranks: Mapping[int, int]) -> BoardCut:
    rule, official = Promotion(round_.season.promotion_percent), round_.closed_at is not None
    last = rule.places(classified)
    racers = [racer for racer, rank in ranks.items() if rank <= last]  # nothing is said of who is below the line
    members = Membership.objects.filter(season=round_.season_id, racer__in=racers)
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
    places = ChampionshipPlace.objects.filter(season=season).exclude(round=round_.pk)
    places = places.filter(round__race__closes_at__lte=round_.race.closes_at)
    held = frozenset(places.values_list("racer_id", flat=True))
    not_free = held | guests_in(round_.race)
    order = classified_order(round_.race, size + len(not_free))
    free = [(rank, racer) for rank, racer in enumerate(order, start=1) if racer not in not_free][:size]
    last = free[-1][0] if free else 0
    return BoardCut(
        round_, last, sentence, round_.closed_at is not None, frozenset(racer for _rank, racer in free), held
    )

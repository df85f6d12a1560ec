"""The board of a race. Any page of it is a handful of queries that read the index ``entry_board``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from django.db.models import OuterRef, Q, QuerySet, Subquery

from ..models import Entry, Race
from ..ranking import MOST_DRIVEN, NOT_CLASSIFIED, rule_for
from .counting import page_of, places_of, totals_of

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

PER_PAGE = 50
PURPLE, GREEN, YELLOW = "purple", "green", "yellow"
ORDER = ("rank_score", "rank_lap", "resets", "achieved_at", "pk")
# A range of the index, unlike the column ``classified``, which says the same.
CLASSIFIED = Q(rank_score__lt=NOT_CLASSIFIED - MOST_DRIVEN)


@dataclass(frozen=True)
class BoardRow:
    """One line of a board; times in milliseconds. Once duels are drawn, times and laps are those of the qualifying.

    ``rank``: None for baselines and for who is not classified. ``gap_ms``: to the leader's score, 0 for the leader,
    negative for a baseline ahead of them, None without a score and once duels are drawn. ``sector_colours``: for each
    sector of the best lap ``"purple"`` (nobody ranked was ever faster there), ``"green"`` (the racer's own best) or
    ``"yellow"``; None without a complete lap. ``has_fastest_lap``: the row is ranked, and nobody ranked has driven a
    faster lap than its best lap.
    """

    rank: int | None
    entry: Entry
    gap_ms: int | None
    sector_colours: tuple[str | None, str | None, str | None]
    has_fastest_lap: bool
    is_me: bool

    @property
    def racer(self) -> Racer:
        return self.entry.racer

    @property
    def alias(self) -> str:
        return self.entry.shown_name

    @property
    def is_baseline(self) -> bool:
        return self.entry.is_baseline

    @property
    def classified(self) -> bool:
        return self.entry.classified

    @property
    def told(self) -> tuple:
        """All that a reader is told in the line, so that lines with the same are drawn the same."""
        entry, racer = self.entry, self.entry.racer
        of_entry = repr([entry.__dict__[field.attname] for field in Entry._meta.concrete_fields])
        run = entry.best and entry.best.evaluation.public_id
        about = (
            racer.alias,
            racer.has_page,
            racer.country,
            racer.avatar,
            run,
            entry.race.ranking_method,
            entry.race.race_type,
        )
        return of_entry, *about, self.rank, self.gap_ms, self.sector_colours, self.has_fastest_lap

    @property
    def group(self) -> str:
        """Which part of the board the row stands in."""
        if self.entry.seed is not None:
            return "drawn"
        return "classified" if self.entry.classified else "others"


@dataclass(frozen=True)
class Board:
    """One page of a board.

    ``rows`` hold racers and, between them by their score, baselines. ``count``: racers on the whole board (without
    baselines), ``classified_count`` of them with a rank. ``my_row``: the reader's row, wherever it stands; None if they
    are not on the board. ``my_entry``: the reader's entry, also one that has left. ``leader_ms``: the leader's score;
    None once duels are drawn, whose board ranks by points. ``drawn``: the rows that are the same for every reader, as
    they were drawn already, by language and what they show.
    """

    race: Race
    rows: list[BoardRow]
    count: int
    classified_count: int
    page: int
    pages: int
    my_row: BoardRow | None
    my_entry: Entry | None
    leader_ms: int | None
    drawn: dict[tuple, str] = field(default_factory=dict, repr=False, compare=False)

    @property
    def is_drawn(self) -> bool:
        """Whether duels are drawn, so that points decide."""
        return any(row.entry.seed is not None for row in self.rows) or (
            self.my_row is not None and self.my_row.entry.seed is not None
        )

    @property
    def my_row_is_elsewhere(self) -> bool:
        """Whether the reader's row is on another page, so that this page pins it."""
        return self.my_row is not None and all(not row.is_me for row in self.rows)


def board(race: Race, racer: Racer | AnonymousUser | None = None, *, page: int = 1, per_page: int = PER_PAGE) -> Board:
    """Page ``page`` (from 1; cut to what there is) of the board of ``race`` as ``racer`` sees it.

    Two queries, one more for a leader or a reader who is not on this page, one more for the ranks of reader and page,
    and one in the middle of a long board; the cost does not grow with the board.
    """
    totals = totals_of(race)
    pages = max(1, -(-totals.rows // per_page))
    page = min(max(1, page), pages)
    offset = (page - 1) * per_page
    entries = list(page_of(_with_relations(board_entries(race)), race, ORDER, offset, per_page, totals.rows))
    view = _View(race, racer)
    mine = next((entry for entry in entries if entry.racer_id == view.reader_id), None)
    elsewhere = view.look_up(entries if offset == 0 else (), reader=mine is None)
    first = next((entry for entry in entries if has_rank(entry)), None) if offset else None
    ranks = ranks_of([entry for entry in (first, elsewhere) if entry is not None])
    above = None if first is None else ranks[first.pk]
    rows = list(view.rows(entries, (above or 1) - 1))
    my_row = next((row for row in rows if row.is_me), None)
    if elsewhere is not None and not elsewhere.is_withdrawn:
        my_row = view.row(elsewhere, ranks[elsewhere.pk])
    return Board(
        race=race,
        rows=rows,
        count=totals.racers,
        classified_count=totals.classified,
        page=page,
        pages=pages,
        my_row=my_row,
        my_entry=mine or elsewhere,
        leader_ms=view.leader_ms,
    )


def as_seen_by(shown: Board, race: Race, racer: Racer | AnonymousUser | None) -> Board:
    """``shown``, a page as guests see it, with what ``racer`` sees of their own. ``race``: the reader's own instance.

    No query for guests and for who is on the page; else their entry, and its rank if it has one.
    """
    view = _View(race, racer, shown.leader_ms)
    if view.reader_id is None:
        return replace(shown, race=race)
    rows = [replace(row, is_me=True) if row.entry.racer_id == view.reader_id else row for row in shown.rows]
    my_row = next((row for row in rows if row.is_me), None)
    mine = my_row.entry if my_row else _with_relations(race.entries.filter(racer_id=view.reader_id)).first()
    if my_row is None and mine is not None and not mine.is_withdrawn:
        my_row = view.row(mine, rank_of(mine))
    return replace(shown, race=race, rows=rows, my_row=my_row, my_entry=mine)


def whole_board(race: Race, racer: Racer | AnonymousUser | None = None) -> Iterator[BoardRow]:
    """Every row of a board in order, read in chunks: for exports."""
    view = _View(race, racer)
    view.look_up()
    return view.rows(_with_relations(board_entries(race)).iterator(chunk_size=1000), 0)


def board_entries(race: Race) -> QuerySet[Entry]:
    """Who is on the board of a race, in its order."""
    return Entry.objects.filter(race=race, withdrawn_at=None).order_by(*ORDER)


def rank_of(entry: Entry) -> int | None:
    """The entry's rank, from 1; None for baselines, for who is not classified and for who has left."""
    return ranks_of([entry])[entry.pk]


def ranks_of(entries: Sequence[Entry]) -> dict[int, int | None]:
    """The rank of each entry by its id, as :func:`rank_of` says it, of any number of races: one query or none."""
    ranks: dict[int, int | None] = {entry.pk: None for entry in entries}
    ranked = [entry.pk for entry in entries if has_rank(entry)]
    if ranked:
        ranks |= {pk: 1 + before for pk, before in places_of(ranked).items()}
    return ranks


def has_rank(entry: Entry) -> bool:
    """Whether an entry has a place on its board."""
    return entry.classified and not entry.is_baseline and not entry.is_withdrawn


def podiums(races: Iterable[Race], size: int = 3) -> dict[int, list[BoardRow]]:
    """The first ``size`` classified rows of each race by its id (empty where nobody is classified): two queries."""
    races = {race.pk: race for race in races}
    ranked = Entry.objects.filter(CLASSIFIED, race=OuterRef("pk"), withdrawn_at=None, is_baseline=False)
    places = {f"place_{n}": Subquery(ranked.order_by(*ORDER).values("pk")[n : n + 1]) for n in range(size)}
    found = Race.objects.filter(pk__in=races).order_by().annotate(**places).values_list("pk", *places)
    ids = {pk: [place for place in rest if place is not None] for pk, *rest in found}
    entries = _with_relations(Entry.objects.all()).in_bulk([place for each in ids.values() for place in each])
    return {
        pk: [
            make_row(
                entries[place], rank, races[pk], _lead(entries[ids[pk][0]].score_ms, entries[ids[pk][0]].seed), None
            )
            for rank, place in enumerate(ids.get(pk, []), start=1)
        ]
        for pk in races
    }


def _lead(score_ms: int | None, seed: int | None) -> int | None:
    """The score that others have a gap to, of the entry that leads: none where points decide."""
    return score_ms if seed is None else None


class _View:
    """What ranks and marks the rows of one board for one reader. ``leader_ms``: the score that others have a gap to."""

    def __init__(self, race: Race, racer: Racer | AnonymousUser | None, leader_ms: int | None = None) -> None:
        self.race = race
        self.reader_id = racer.pk if racer is not None and racer.is_authenticated else None
        self.leader_ms = leader_ms

    def look_up(self, first_page: Sequence[Entry] = (), *, reader: bool = False) -> Entry | None:
        """Find the leader, in ``first_page`` or in the database, and in the same query the reader's entry, also one
        that has left the board, where ``reader`` asks for it."""
        leader = next((entry for entry in first_page if has_rank(entry)), None)
        wanted = []
        if reader and self.reader_id is not None:
            wanted.append(Entry.objects.filter(race=self.race, racer_id=self.reader_id).values("pk")[:1])
        if leader is None:
            wanted.append(board_entries(self.race).filter(CLASSIFIED, is_baseline=False).values("pk")[:1])
        mine = None
        if wanted:  # by their numbers: an OR would read the whole board
            entries = Entry.objects.filter(pk__in=[Subquery(each) for each in wanted])
            found = list(_with_relations(entries.order_by(*ORDER)))
            if leader is None:
                leader = next((entry for entry in found if has_rank(entry)), None)
            mine = next((entry for entry in found if reader and entry.racer_id == self.reader_id), None)
        if leader is not None:
            self.leader_ms = _lead(leader.score_ms, leader.seed)
        if mine is not None:
            mine.race = self.race
        return mine

    def rows(self, entries: Iterable[Entry], rank: int) -> Iterator[BoardRow]:
        """Rows for entries that follow each other on the board; ``rank``: how many with a rank stand above them."""
        for entry in entries:
            if has_rank(entry):
                rank += 1
                yield self.row(entry, rank)
            else:
                yield self.row(entry, None)

    def row(self, entry: Entry, rank: int | None) -> BoardRow:
        """A line for an entry whose rank is known."""
        return make_row(entry, rank, self.race, self.leader_ms, self.reader_id)


def make_row(entry: Entry, rank: int | None, race: Race, leader_ms: int | None, reader_id: int | None) -> BoardRow:
    """A line of the board of ``race``; ``rank`` and ``leader_ms`` as the caller found them."""
    entry.race = race
    gap = entry.score_ms - leader_ms if entry.score_ms is not None and leader_ms is not None else None
    if gap is not None and gap < 0 and not entry.is_baseline:
        gap = None  # a faster qualifying than the leader's drive in the live event, which counts before it
    fastest = race.fastest_lap_ms
    return BoardRow(
        rank=rank,
        entry=entry,
        gap_ms=gap,
        sector_colours=_colours(entry, race),
        has_fastest_lap=has_rank(entry) and fastest is not None and entry.best_lap_ms == fastest,
        is_me=reader_id is not None and entry.racer_id == reader_id,
    )


def _colours(entry: Entry, race: Race) -> tuple[str | None, str | None, str | None]:
    if len(entry.sectors) != 3:
        return None, None, None
    marks = []
    for time_ms, own, fastest in zip(entry.sectors, entry.own_sectors_ms, race.fastest_sectors_ms, strict=True):
        if has_rank(entry) and fastest is not None and time_ms <= fastest:
            marks.append(PURPLE)
        else:
            marks.append(GREEN if own is not None and time_ms <= own else YELLOW)
    first, second, third = marks
    return first, second, third


def _with_relations(entries: QuerySet[Entry]) -> QuerySet[Entry]:
    return entries.select_related("racer", "best__evaluation", "car_of__racer")


def score_column(race: Race) -> str:
    """Heading of the column that the board is ranked by, in the reader's language."""
    return str(rule_for(race).column)

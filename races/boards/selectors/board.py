"""The board of a race. Any page of it is a handful of queries that read the index ``entry_board``."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from operator import itemgetter
from typing import Any

from django.db.models import OuterRef, Q, QuerySet, Subquery

from accounts.groups.selectors import inside, visible_of
from accounts.models import Racer, RacerGroup, Team, Viewer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from evaluation.models import Evaluation

from ...models import Entry, Race
from ...ranks import MOST_DRIVEN, NOT_CLASSIFIED
from .counts import page_of, places_of, totals_of, with_place

PER_PAGE = 50
MOST_IN_TEAMS = 10_000  # classified cars that the board of teams looks at
PURPLE, GREEN, YELLOW = "purple", "green", "yellow"
ORDER = ("rank_score", "rank_lap", "resets", "achieved_at", "pk")
# The column ``classified`` as a range of the index.
CLASSIFIED = Q(rank_score__lt=NOT_CLASSIFIED - MOST_DRIVEN)


@dataclass(frozen=True)
class BoardRow:
    """One line of a board; times in milliseconds. Once duels are drawn, times and laps are those of the qualifying.

    ``rank``: None for baselines and unclassified entries. ``gap_ms``: to the leader's score, negative for a baseline
    ahead, None without a score and once duels are drawn. ``interval_ms``: the same to the ranked racer ahead.
    ``sector_colours``: ``"purple"`` for the race's best, ``"green"`` for the racer's own best, else ``"yellow"``; None
    without a complete lap. ``above``: the entry of the line above, if this page has it.
    """

    rank: int | None
    entry: Entry
    gap_ms: int | None
    sector_colours: tuple[str | None, str | None, str | None]
    has_fastest_lap: bool
    is_me: bool
    interval_ms: int | None = None
    above: Entry | None = None

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
    def gained(self) -> int | None:
        """Places gained since the start of the day, negative for lost ones; None without a rank then or now."""
        then = self.entry.day_rank
        if self.rank is None or then is None or self.entry.race.day_of_ranks is None or self.entry.seed is not None:
            return None
        return then - self.rank

    @property
    def sector_gaps(self) -> tuple[int, ...]:
        """By sector of the best laps the milliseconds behind the line above; empty where one has no sectors."""
        theirs = self.above.sectors if self.above is not None else ()
        return tuple(own - other for own, other in zip(self.entry.sectors, theirs, strict=False))

    @property
    def shown_values(self) -> tuple:
        """All values of the row that its line shows: equal values draw equal lines in the same race and minute."""
        entry, racer = self.entry, self.entry.racer
        of_entry = repr([entry.__dict__[field.attname] for field in Entry._meta.concrete_fields])
        of_racer = (racer.alias, racer.has_page, racer.country, racer.avatar)
        about = (entry.best and entry.best.evaluation.public_id, entry.car_of and entry.car_of.racer.alias)
        above = self.above and (self.above.shown_name, self.above.best and self.above.best.evaluation.public_id)
        gaps = self.sector_gaps
        shown = (self.rank, self.gap_ms, self.interval_ms, above, gaps, self.sector_colours, self.has_fastest_lap)
        return of_entry, *of_racer, *about, *shown

    @property
    def group(self) -> str:
        if self.entry.seed is not None:
            return "drawn"
        return "classified" if self.entry.classified else "others"


@dataclass(frozen=True)
class Board:
    """One page of a board.

    ``rows``: racers and, by their score, baselines. ``count``: racers on the whole board, ``classified_count`` of them
    with a rank. ``my_row``, ``my_entry``: the reader's, wherever they stand; the entry also of a reader who has left.
    ``leader_ms``: the leader's score; None once duels are drawn. ``is_drawn``: whether they are, so that points decide.
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
    is_drawn: bool

    @property
    def my_row_is_elsewhere(self) -> bool:
        """Whether the reader's row is on another page, so that this page pins it."""
        return self.my_row is not None and all(not row.is_me for row in self.rows)

    @property
    def rival(self) -> tuple[Entry, int] | None:
        """The house car just ahead of the reader and by how many milliseconds, if this page has both."""
        mine = self.my_row
        if mine is None or self.my_row_is_elsewhere or mine.gap_ms is None:
            return None
        ahead = [
            (row.entry, mine.gap_ms - row.gap_ms)
            for row in self.rows
            if row.is_baseline and row.gap_ms is not None and row.gap_ms < mine.gap_ms
        ]
        return min(ahead, key=itemgetter(1), default=None)


def board(race: Race, racer: Viewer = None, *, page: int = 1, per_page: int = PER_PAGE) -> Board:
    """Page ``page`` (from 1; cut to what there is) of a board, in at most five queries, however long it is."""
    totals = totals_of(race)
    page, pages, offset = _cut(page, totals.rows, per_page)
    before = min(offset, 1)  # the line above the page
    entries = list(
        page_of(_with_relations(board_entries(race)), race, ORDER, offset - before, per_page + before, totals.rows)
    )
    above, entries = entries[:before], entries[before:]
    view = _View(race, racer)
    mine = next((entry for entry in entries if entry.racer_id == view.reader_id), None)
    elsewhere = view.look_up(entries if offset == 0 else (), reader=mine is None)
    first = next((entry for entry in entries if has_rank(entry)), None) if offset else None
    ranks = ranks_of([entry for entry in (first, elsewhere) if entry is not None])
    first_rank = None if first is None else ranks[first.pk]
    rows = list(view.rows(entries, (first_rank or 1) - 1, next(iter(above), None)))
    my_row = next((row for row in rows if row.is_me), None)
    if elsewhere is not None and not elsewhere.is_withdrawn:
        my_row = view.row(elsewhere, ranks[elsewhere.pk])
    counts = (totals.racers, totals.classified)
    return Board(race, rows, *counts, page, pages, my_row, mine or elsewhere, view.leader_ms, view.is_drawn)


def groups_on(race: Race, racer: Viewer, most: int = 12) -> list[RacerGroup]:
    """Groups that the reader may see and that have a member on the board: one query, or none where all are listed."""
    groups = shared_value(("groups on a board", race.pk), lambda: _groups_on(race.pk))
    return visible_of(groups, racer)[:most]


def _groups_on(race: int) -> list[RacerGroup]:
    groups = RacerGroup.objects.filter(
        members__confirmed_at__isnull=False,
        members__racer__entries__race=race,
        members__racer__entries__withdrawn_at=None,
    )
    return list(groups.distinct().order_by("-is_listed", "name", "pk"))


def group_board(race: Race, group: RacerGroup, *, page: int = 1, per_page: int = PER_PAGE) -> Board:
    """A page of a board with the confirmed members of ``group`` alone, ranked among each other, as guests see it. Four
    queries."""
    entries = board_entries(race).filter(racer__in=inside(group).values("racer"), is_baseline=False)
    count, classified = entries.count(), entries.filter(CLASSIFIED).count()
    page, pages, offset = _cut(page, count, per_page)
    shown = list(_with_relations(entries)[offset : offset + per_page])
    first = entries.filter(CLASSIFIED).first() if offset else next(iter(shown), None)
    view = _View(race, None)
    if first is not None and has_rank(first):
        view.follow(first)
    rows = list(view.rows(shown, offset))
    return Board(race, rows, count, classified, page, pages, None, None, view.leader_ms, view.is_drawn)


@dataclass
class TeamRow:
    """A team on a board. ``entries``: its classified cars, the best first; ``places``: theirs among all racers."""

    rank: int
    team: Team
    entries: list[Entry] = field(default_factory=list)
    places: list[int] = field(default_factory=list)


def team_board(race: Race) -> list[TeamRow]:
    """Teams in the order of their best classified cars: two queries. A racer counts for the team that they are in."""
    ranked = board_entries(race).filter(CLASSIFIED, is_baseline=False).select_related("racer__team_membership__team")
    rows: dict[int, TeamRow] = {}
    for place, entry in enumerate(islice(ranked.iterator(chunk_size=1000), MOST_IN_TEAMS), start=1):
        member = getattr(entry.racer, "team_membership", None)
        if member is None:
            continue
        entry.race = race
        row = rows.setdefault(member.team_id, TeamRow(len(rows) + 1, member.team))
        row.entries.append(entry)
        row.places.append(place)
    return list(rows.values())


def _cut(page: int, rows: int, per_page: int) -> tuple[int, int, int]:
    """The page cut to what there is, the number of pages, and the rows before the page."""
    pages = max(1, -(-rows // per_page))
    page = min(max(1, page), pages)
    return page, pages, (page - 1) * per_page


# of related rows, of which a line shows only an address and a name
_NOT_SHOWN = [
    f"{path}__{field.name}"
    for path, model, shown in (
        ("best__evaluation", Evaluation, {"id", "public_id"}),
        ("car_of", Entry, {"id", "racer"}),
        ("car_of__racer", Racer, {"id", "alias"}),
    )
    for field in model._meta.concrete_fields
    if field.name not in shown
]


def with_ahead_score(entries: QuerySet[Entry]) -> QuerySet[Any]:
    """``entries`` with ``ahead_score``, the ``rank_score`` of the nearest racer with a better one."""
    ranked = Entry.objects.filter(race=OuterRef("race"), withdrawn_at=None, is_baseline=False)
    ahead = ranked.filter(rank_score__lt=OuterRef("rank_score")).order_by("-rank_score").values("rank_score")
    return entries.annotate(ahead_score=Subquery(ahead[:1]))


def to_gain_ms(entry: Any) -> int | None:
    """Milliseconds to the racer ahead of an entry of :func:`with_ahead_score`; None for the first, and where duels or a
    live event decide."""
    if entry.seed is not None or entry.is_live or not entry.classified or (entry.ahead_score or -1) < 0:
        return None
    gap: int = entry.rank_score - entry.ahead_score
    return gap


_own: KeptQuery[Any] = KeptQuery(
    lambda race, racer: with_place(
        with_ahead_score(Entry.objects.filter(race_id=race, racer_id=racer))
        .select_related("best__evaluation", "car_of__racer")
        .defer(*_NOT_SHOWN)
        .order_by()
    )
)


def as_seen_by(shown: Board, race: Race, racer: Viewer, *, pinned: bool = True) -> Board:
    """``shown``, a page as guests see it, with the racer's own row: one query for a racer on another page. ``pinned``:
    with a row also for a racer on another page."""
    view = _View(race, racer, shown.leader_ms)
    if view.reader_id is None:
        return replace(shown, race=race)
    rows = [replace(row, is_me=True) if row.entry.racer_id == view.reader_id else row for row in shown.rows]
    my_row = next((row for row in rows if row.is_me), None)
    if my_row is not None:
        return replace(shown, race=race, rows=rows, my_row=my_row, my_entry=my_row.entry)
    mine = next(iter(_own(race=race.pk, racer=view.reader_id)), None)
    if mine is not None and racer is not None:
        mine.race, mine.racer = race, racer
    if pinned and mine is not None and not mine.is_withdrawn:
        my_row = view.row(mine, 1 + mine.place if has_rank(mine) else None)
        my_row = replace(my_row, interval_ms=to_gain_ms(mine))
    return replace(shown, race=race, my_row=my_row, my_entry=mine)


def whole_board(race: Race) -> Iterator[BoardRow]:
    """Every row of a board in order, read in chunks: for exports."""
    view = _View(race, None)
    view.look_up()
    return view.rows(_with_relations(board_entries(race)).iterator(chunk_size=1000), 0)


def board_entries(race: Race) -> QuerySet[Entry]:
    return Entry.objects.filter(race=race, withdrawn_at=None).order_by(*ORDER)


def rank_of(entry: Entry) -> int | None:
    """The entry's rank, from 1; None for baselines, unclassified and withdrawn entries."""
    return ranks_of([entry])[entry.pk]


def ranks_of(entries: Sequence[Entry]) -> dict[int, int | None]:
    """The rank of each entry by id, as in :func:`rank_of`, across any races: one query or none."""
    ranks: dict[int, int | None] = {entry.pk: None for entry in entries}
    ranked = [entry.pk for entry in entries if has_rank(entry)]
    if ranked:
        ranks |= {pk: 1 + before for pk, before in places_of(ranked).items()}
    return ranks


def has_rank(entry: Entry) -> bool:
    return entry.classified and not entry.is_baseline and not entry.is_withdrawn


def podiums(races: Iterable[Race], size: int = 3) -> dict[int, list[BoardRow]]:
    """The first ``size`` classified rows of each race by its id (empty where nobody is classified): two queries."""
    races = {race.pk: race for race in races}
    ranked = Entry.objects.filter(CLASSIFIED, race=OuterRef("pk"), withdrawn_at=None, is_baseline=False)
    places = {f"place_{n}": Subquery(ranked.order_by(*ORDER).values("pk")[n : n + 1]) for n in range(size)}
    found = Race.objects.filter(pk__in=races).order_by().annotate(**places).values_list("pk", *places)
    ids = {pk: [place for place in rest if place is not None] for pk, *rest in found}
    entries = _with_relations(Entry.objects.all()).in_bulk([place for each in ids.values() for place in each])
    ranked_by_race = {pk: [entries[place] for place in ids.get(pk, [])] for pk in races}
    return {
        pk: list(_View(races[pk], None, _lead(first[0])).rows(first, 0)) if first else []
        for pk, first in ranked_by_race.items()
    }


def to_beat(podiums: Mapping[int, Sequence[BoardRow]], most: int = 3) -> dict[int, list[Entry]]:
    """The best classified house cars of each race of ``podiums`` without a classified racer, by the race's id."""
    waiting = [pk for pk, rows in podiums.items() if not rows]
    if not waiting:
        return {}
    entries = Entry.objects.filter(CLASSIFIED, race__in=waiting, withdrawn_at=None, is_baseline=True)
    best: dict[int, list[Entry]] = {}
    for entry in entries.select_related("racer", "best__evaluation").order_by(*ORDER):
        best.setdefault(entry.race_id, []).append(entry)
    return {pk: cars[:most] for pk, cars in best.items()}


def _lead(leader: Entry) -> int | None:
    """The leader's score, which gaps refer to: None where points decide."""
    return leader.score_ms if leader.seed is None else None


class _View:
    """Ranks and marks of one board's rows for one reader. ``leader_ms``: the score that gaps refer to."""

    def __init__(self, race: Race, racer: Viewer, leader_ms: int | None = None) -> None:
        self.race = race
        self.reader_id = racer.pk if racer is not None and racer.is_authenticated else None
        self.leader_ms = leader_ms
        self.is_drawn = False

    def follow(self, leader: Entry) -> None:
        """Refer gaps to this leader's score."""
        self.leader_ms, self.is_drawn = _lead(leader), leader.seed is not None

    def look_up(self, first_page: Sequence[Entry] = (), *, reader: bool = False) -> Entry | None:
        """Find the leader, in ``first_page`` or the database, and in the same query the reader's entry."""
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
            self.follow(leader)
        if mine is not None:
            mine.race = self.race
        return mine

    def rows(self, entries: Iterable[Entry], rank: int, above: Entry | None = None) -> Iterator[BoardRow]:
        """Rows for entries that follow each other on the board; ``rank``: how many with a rank stand above them,
        ``above``: the entry just above, if known."""
        ahead = above if above is not None and has_rank(above) else None
        for entry in entries:
            rank += has_rank(entry)
            row = self.row(entry, rank if has_rank(entry) else None)
            yield replace(row, interval_ms=_interval(entry, ahead), above=above)
            above, ahead = entry, entry if has_rank(entry) else ahead

    def row(self, entry: Entry, rank: int | None) -> BoardRow:
        """A line for an entry whose rank is known."""
        entry.race = self.race
        gap = None if entry.score_ms is None or self.leader_ms is None else entry.score_ms - self.leader_ms
        if gap is not None and gap < 0 and not entry.is_baseline:
            gap = None  # a faster qualifying than the leader's drive in the live event, which counts before it
        fastest = self.race.fastest_lap_ms
        return BoardRow(
            rank=rank,
            entry=entry,
            gap_ms=gap,
            sector_colours=_colours(entry, self.race),
            has_fastest_lap=has_rank(entry) and fastest is not None and entry.best_lap_ms == fastest,
            is_me=self.reader_id is not None and entry.racer_id == self.reader_id,
        )


def _interval(entry: Entry, ahead: Entry | None) -> int | None:
    if ahead is None or not entry.classified or (entry.seed, entry.is_live) != (None, ahead.is_live):
        return None
    return (entry.score_ms or 0) - (ahead.score_ms or 0) if ahead.seed is None else None


def sector_colour(time_ms: int, own: int | None, fastest: int | None) -> str:
    """Purple as fast as the race's best, green as the own best, else yellow."""
    if fastest is not None and time_ms <= fastest:
        return PURPLE
    return GREEN if own is not None and time_ms <= own else YELLOW


def _colours(entry: Entry, race: Race) -> tuple[str | None, str | None, str | None]:
    if len(entry.sectors) != 3:
        return None, None, None
    fastest = race.fastest_sectors_ms if has_rank(entry) else (None, None, None)
    first, second, third = map(sector_colour, entry.sectors, entry.own_sectors_ms, fastest)
    return first, second, third


def _with_relations(entries: QuerySet[Entry]) -> QuerySet[Entry]:
    return entries.select_related("racer", "best__evaluation", "car_of__racer")

"""Import of recorded seasons: races, results and racers become rows, and our rules compute round after round.

Imported races have entries with standings and no submissions; racers become accounts without log-in; a track without a
match keeps only its name.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import Any

from django.core.exceptions import ValidationError
from django.db import IntegrityError, connection, models, transaction
from django.utils.text import slugify

from accounts.models import Racer
from accounts.models.racer import ALIAS_VALIDATORS
from paddock.errors import UserFault
from paddock.geometry.catalogue.names import direction_in
from races.boards.ranking import drawn_rank
from races.entries.services.standings import recompute_fastest
from races.errors import RaceRefused
from races.models import DuelFormat, Entry, Opponents, Race, RaceKind, RaceType
from races.models.race import RESERVED_SLUGS as RACE_PAGES
from races.ranks import LAST, NOT_CLASSIFIED
from tracks.models import Track
from tracks.services import recorded_track

from ..models import RecordedRace, RecordedResult, RecordedSeason, Round, Season
from ..models.season import DIVISION_OF, WORD_OF, Stage
from ..seasons.selectors import season_at
from ..seasons.services.seasons import create_season
from ..stewarding.official_results import close_round
from .columns import ResultRow
from .folder_reader import ReadRace, ReadSeason, read_folder

# An address that never receives anything (RFC 2606).
_EMAIL = "{name}@record.invalid"


def import_folder(*, folder: Path, now: datetime, season: str | None = None, **settings: Any) -> list[Season]:
    """Import the seasons of a folder, or the one named ``season``, all of them or nothing; known ones are returned.

    ``settings``: the numbers of a season. Raises UserFault("import_..."), and what contradicts itself in ``settings``.
    """
    read = read_folder(folder, season)
    try:
        with transaction.atomic():
            return [_import_season(one, now, settings) for one in read]
    except IntegrityError:  # somebody imported the same at the same time: theirs is found now
        with transaction.atomic():
            return [_import_season(one, now, settings) for one in read]


def _import_season(read: ReadSeason, now: datetime, settings: dict[str, Any]) -> Season:
    known = RecordedSeason.objects.select_related("season").filter(label=read.label).first()
    if known is not None:
        if known.digest != read.digest:
            raise UserFault("import_season_differs", season=read.label)
        other = [name for name, value in settings.items() if getattr(known.season, name) != value]
        if other:
            raise UserFault("import_numbers_differ", season=read.label, number=other[0])
        return known.season
    season = _make_season(read, settings)
    RecordedSeason.objects.create(season=season, label=read.label, digest=read.digest, imported_at=now)
    racers = _racers(read, now)
    tracks = {name: recorded_track(name, now=now) for name in sorted({race.row.track for race in read.races})}
    rounds = []
    for position, race in enumerate(read.races, start=1):
        made = _make_race(race, position, tracks[race.row.track], now)
        _make_entries(made, race.results, racers)
        recompute_fastest(race=made)
        round_ = Round(season=season, number=race.number, stage=race.row.stage, name=race.row.name, race=made)
        round_.save(force_insert=True)
        rounds.append(round_)
    for round_ in sorted(rounds, key=lambda one: (one.race.closes_at, one.pk)):
        close_round(round=round_, now=round_.race.closes_at)
    return season


def _make_season(read: ReadSeason, settings: dict[str, Any]) -> Season:
    slug = slugify(read.label)[:50] or "season"
    if season_at(slug) is not None:
        raise UserFault("import_season_exists", season=slug)
    first = min(race.row.opens_at for race in read.races).date()
    last = max(race.row.closes_at for race in read.races).date()
    last = max(last, first + timedelta(days=1))
    try:
        return create_season(slug=slug, name=read.label, starts_on=first, ends_on=last, continues=False, **settings)
    except ValidationError as refused:
        raise RaceRefused(refused) from None


def _racers(read: ReadSeason, now: datetime) -> dict[str, int]:
    """The id of every racer of the season by their id in the record; those that are not here yet are made."""
    wanted = {result.racer: result.alias for race in read.races for result in race.results}
    known = _recorded_racers()
    new = {racer: alias for racer, alias in wanted.items() if racer not in known}
    taken = {alias.lower() for alias in Racer.objects.values_list("alias", flat=True)} if new else set()
    rows = [_racer(racer, _free_alias(alias, racer, taken), now) for racer, alias in new.items()]
    insert_rows(Racer, ("alias", "email", "password", "is_active", "joined_at", "record_id"), rows)
    return _recorded_racers()


def _recorded_racers() -> dict[str, int]:
    found = Racer.objects.exclude(record_id=None).values_list("record_id", "pk")
    return {record_id: pk for record_id, pk in found if record_id is not None}


def _racer(record_id: str, alias: str, now: datetime) -> tuple:
    name = hashlib.sha256(record_id.encode()).hexdigest()[:32]
    # "!": a password that nothing matches
    return alias, _EMAIL.format(name=name), "!", False, now, record_id


def _free_alias(alias: str, record_id: str, taken: set[str]) -> str:
    """The recorded alias if it can be one here and it is free, else one that names its origin."""
    try:
        for validate in ALIAS_VALIDATORS:
            validate(alias)
    except ValidationError:
        alias = f"record-{hashlib.sha256(record_id.encode()).hexdigest()[:12]}"
    free, number = alias, 1
    while free.lower() in taken:
        number += 1
        free = f"{alias[:58]}-{number}"
    taken.add(free.lower())
    return free


def _make_race(read: ReadRace, position: int, track: Track, now: datetime) -> Race:
    row = read.row
    title = None if row.stage == Stage.SINGLE else WORD_OF[row.stage]
    head_to_head = row.race_type == RaceType.HEAD_TO_HEAD
    duel = next((result.duel for result in read.results if result.duel is not None), None)
    race = Race(
        slug=_free_slug(Path(row.file).stem),
        kind=RaceKind.LEAGUE,
        division=DIVISION_OF[row.stage],
        name=row.name if title is None else f"{row.name[: 61 - len(title)]} · {title}",
        track=track,
        direction=direction_in(row.track) or track.direction,
        race_type=row.race_type,
        ranking_method=row.ranking_method,
        **row.laps_of_the_race,
        **row.penalties,
        random_boxes=row.obstacles if row.race_type == RaceType.OBJECT_AVOIDANCE else 0,
        opponents=Opponents.MODELS if duel else Opponents.BOTS if head_to_head and row.bots else "",
        duel_format="" if duel is None else DuelFormat.BRACKET if duel.bracket else DuelFormat.ROUND_ROBIN,
        duel_cars=2 if duel is None else duel.cars,
        bots=row.bots if head_to_head else 0,
        max_submissions=None,
        opens_at=row.opens_at,
        closes_at=row.closes_at,
        created_at=now,
        imported_at=now,
    )
    if row.bot_speed_mps is not None:
        race.bot_speed_mps = row.bot_speed_mps
    race.save(force_insert=True)
    RecordedRace.objects.create(
        race=race, position=position, row=dict(row.cells), heading=read.heading, decimals=read.decimals
    )
    return race


def _free_slug(stem: str) -> str:
    limit = Race._meta.get_field("slug").max_length
    slug = base = slugify(stem)[: limit - 6] or "imported"
    number = 1
    while slug in RACE_PAGES or Race.objects.filter(slug=slug).exists():
        number += 1
        slug = f"{base}-{number}"
    return slug


def _make_entries(race: Race, results: Sequence[ResultRow], racers: dict[str, int]) -> None:
    rows = [(race.pk, racers[one.racer], *_values_of_entry(one), *_standing(one)) for one in results]
    insert_rows(Entry, _ENTRY, rows)
    entries = dict(Entry.objects.filter(race=race).values_list("racer", "pk"))
    records = [(entries[racers[one.racer]], *_values_of_record(one)) for one in results]
    insert_rows(RecordedResult, ("entry", *_RECORD), records)


# Columns of an entry by the value of a result that stands in them; _standing makes the others.
_OF_RESULT = {
    "entered_at": "submitted_at",
    "achieved_at": "submitted_at",
    "submission_count": "submissions",
    "last_number": "submissions",
    "complete_laps": "laps",
    **{name: name for name in ("score_ms", "average_ms", "best_lap_ms", "total_ms", "off_tracks", "resets")},
}
_DRAWN = ("seed", "points", "duels", "duel_lap_ms")
_ENTRY = ("race", "racer", *_OF_RESULT, "classified", "own_lap_ms", "rank_score", "rank_lap", *_DRAWN)
_RECORD = ("alias", "rank", "score", "measured", "collisions", "average_resets", "status", "division", "blank")
_values_of_entry, _values_of_record = attrgetter(*_OF_RESULT.values()), attrgetter(*_RECORD)


def _standing(result: ResultRow) -> tuple:
    """What a recorded result is worth: its score, or how far the car drove."""
    classified, duel = result.score_ms is not None, result.duel
    own_lap = result.best_lap_ms if classified else None
    if duel is not None and duel.seed is not None:
        rank = drawn_rank(duel.points, duel.lap_ms, duel.seed)
        return classified, own_lap, *rank, duel.seed, duel.points, duel.duels, duel.lap_ms
    score = NOT_CLASSIFIED - result.driven_percent if result.score_ms is None else result.score_ms
    return classified, own_lap, score, LAST if result.best_lap_ms is None else result.best_lap_ms, None, 0, 0, None


BATCH = 1000  # rows of up to 65 columns: PostgreSQL takes 65,535 values in a statement
# What the database's driver takes as it is. Others are prepared value by value.
_PLAIN = (models.IntegerField, models.BooleanField, models.CharField, models.FloatField, models.ForeignKey)


def insert_rows(model: type[models.Model], columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> int:
    """Insert ``rows``, the values of ``columns`` (foreign keys: the id), with defaults for other fields; returns how
    many.

    Several times as fast as ``bulk_create``, which makes an object of every row. Raises IntegrityError.
    """
    named: Mapping[str, models.Field] = {field.name: field for field in model._meta.concrete_fields}
    rest = [field for name, field in named.items() if name not in columns and not isinstance(field, models.AutoField)]
    fields = [named[name] for name in columns] + rest
    defaults = tuple(_prepared(field)(field.get_default()) for field in rest)
    prepare = [None if isinstance(named[name], _PLAIN) else _prepared(named[name]) for name in columns]
    values = (
        (*(value if ready is None else ready(value) for value, ready in zip(row, prepare, strict=True)), *defaults)
        for row in rows
    )
    quote = connection.ops.quote_name
    into_columns = ", ".join(quote(field.column or "") for field in fields)
    into = f"INSERT INTO {quote(model._meta.db_table)} ({into_columns}) VALUES "
    one = f"({', '.join(['%s'] * len(fields))})"
    count = 0
    with transaction.atomic(), connection.cursor() as cursor:
        while batch := list(islice(values, BATCH)):
            count += len(batch)
            if connection.vendor == "sqlite":
                cursor.executemany(into + one, batch)
            else:  # a server counts and answers statements, so there are few of them
                cursor.execute(into + ", ".join([one] * len(batch)), [value for row in batch for value in row])
    return count


def _prepared(field: models.Field) -> Callable[[Any], Any]:
    return lambda value: field.get_db_prep_save(value, connection)

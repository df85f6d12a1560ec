"""Import of recorded seasons: races, results and racers become rows, and our rules compute round after round.

Imported races have entries with standings and no submissions; racers become accounts without log-in; a track without a
match keeps only its name.
"""

import hashlib
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
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
BATCH = 1000  # rows of up to 65 columns: PostgreSQL takes 65,535 values in a statement


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


def _import_season(read: ReadSeason, now: datetime, settings: dict[str, object]) -> Season:
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


def _make_season(read: ReadSeason, settings: dict[str, object]) -> Season:
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
    recorded = Racer.objects.exclude(record_id=None).values_list("record_id", "pk")
    known = {str(record_id): pk for record_id, pk in recorded}
    new = {racer: alias for racer, alias in wanted.items() if racer not in known}
    taken = {alias.lower() for alias in Racer.objects.values_list("alias", flat=True)} if new else set()
    rows = [_racer(racer, _free_alias(alias, racer, taken), now) for racer, alias in new.items()]
    made = Racer.objects.bulk_create(rows, batch_size=BATCH)
    return known | {racer: row.pk for racer, row in zip(new, made, strict=True)}


def _racer(record_id: str, alias: str, now: datetime) -> Racer:
    email = _EMAIL.format(name=hashlib.sha256(record_id.encode()).hexdigest()[:32])
    # "!": a password that nothing matches
    return Racer(alias=alias, email=email, password="!", is_active=False, joined_at=now, record_id=record_id)


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
    rows = [
        Entry(
            race=race,
            racer_id=racers[one.racer],
            **{column: getattr(one, name) for column, name in _OF_RESULT.items()},
            **_standing(one),
        )
        for one in results
    ]
    entries = Entry.objects.bulk_create(rows, batch_size=BATCH)
    records = (
        RecordedResult(entry=entry, **{name: getattr(one, name) for name in _RECORD})
        for entry, one in zip(entries, results, strict=True)
    )
    RecordedResult.objects.bulk_create(records, batch_size=BATCH)


# Columns of an entry by the value of a result that stands in them; _standing makes the others.
_OF_RESULT = {
    "entered_at": "submitted_at",
    "achieved_at": "submitted_at",
    "submission_count": "submissions",
    "last_number": "submissions",
    "complete_laps": "laps",
    **{name: name for name in ("score_ms", "average_ms", "best_lap_ms", "total_ms", "off_tracks", "resets")},
}
_RECORD = ("alias", "rank", "score", "measured", "collisions", "average_resets", "status", "division", "blank")


def _standing(result: ResultRow) -> dict[str, object]:
    """What a recorded result is worth: its score, or how far the car drove."""
    classified, duel = result.score_ms is not None, result.duel
    worth: dict[str, object] = {"classified": classified, "own_lap_ms": result.best_lap_ms if classified else None}
    if duel is not None and duel.seed is not None:
        score, lap = drawn_rank(duel.points, duel.lap_ms, duel.seed)
        worth |= {"seed": duel.seed, "points": duel.points, "duels": duel.duels, "duel_lap_ms": duel.lap_ms}
    else:
        score = NOT_CLASSIFIED - result.driven_percent if result.score_ms is None else result.score_ms
        lap = LAST if result.best_lap_ms is None else result.best_lap_ms
    return worth | {"rank_score": score, "rank_lap": lap}

"""Importing recorded seasons: races, results and racers as rows like all others, then round after round by our rules.

An imported race is a league race with ``imported_at``: its entries have standings and no submissions. What the record
says besides stands in :mod:`league.models.record`. Racers become accounts that nobody can log in to. A track is found
by its address or any of its names; without a match only the name is kept, never a shape.
"""

from __future__ import annotations

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
from races.errors import RaceRefused
from races.models import DuelFormat, Entry, Opponents, Race, RaceKind, RaceType
from races.models.race import RESERVED_SLUGS as RACE_PAGES
from races.ranking import LAST, NOT_CLASSIFIED, drawn_rank
from races.services.standings import recompute_fastest
from tracks.models import Track
from tracks.services import recorded_track

from ..history import ReadRace, ReadSeason, ResultRow, read_folder
from ..history.form import NO_SCORE
from ..models import RecordedRace, RecordedResult, RecordedSeason, Round, Season
from ..models.season import DIVISION_OF, Stage
from ..selectors.addresses import season_at
from .bulk import insert_rows
from .closing import close_round
from .seasons import create_season

# An address that never receives anything (RFC 2606).
_EMAIL = "{name}@record.invalid"
_TITLES = {Stage.OPEN: "open", Stage.PRO: "pro", Stage.FINALE: "finale", Stage.CHAMPIONSHIP: "championship"}


def import_folder(*, folder: Path, now: datetime, season: str | None = None, **settings: Any) -> list[Season]:
    """Import the seasons of a folder, or the one named ``season``, all of them or nothing.

    ``settings``: the numbers of a season (``promotion_percent``, ``points`` and so on) that its rounds are worked out
    with. A season that was imported from the same files before is returned as it is. Raises UserFault("import_...") for
    what is wrong in the files, "import_season_differs", "import_numbers_differ", "import_season_exists", or what
    contradicts itself in ``settings``.
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
    """The recorded alias if it can be one here and nobody has it, else one that says where it comes from."""
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
    title = _TITLES.get(row.stage)
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
        off_track_penalty_ms=row.off_track_penalty_ms,
        collision_penalty_ms=row.collision_penalty_ms,
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
    """Entries with their standings in the order of the record, and what else it says about each."""
    insert_rows(Entry, _ENTRY, [(race.pk, racers[result.racer], *_standing(result)) for result in results])
    entries = dict(Entry.objects.filter(race=race).values_list("racer", "pk"))
    insert_rows(RecordedResult, _RECORD, [(entries[racers[one.racer]], *_recorded(one)) for one in results])


_ENTRY = (
    *("race", "racer", "entered_at", "submission_count", "last_number", "classified", "score_ms", "average_ms"),
    *("best_lap_ms", "total_ms", "complete_laps", "off_tracks", "resets", "achieved_at", "rank_score", "rank_lap"),
    *("own_lap_ms", "seed", "points", "duels", "duel_lap_ms"),
)
_RECORD = (
    *("entry", "alias", "rank", "score", "measured", "collisions", "average_resets", "status", "division", "blank"),
)


def _standing(result: ResultRow) -> tuple:
    """What a recorded result is worth: its score, or how far the car drove."""
    classified = result.score_ms is not None
    duel = result.duel
    if duel is not None and duel.seed is not None:
        rank = drawn_rank(duel.points, duel.lap_ms, duel.seed)
        drawn: tuple[int | None, int, int, int | None] = duel.seed, duel.points, duel.duels, duel.lap_ms
    else:
        rank = (
            NOT_CLASSIFIED - result.driven_percent if result.score_ms is None else result.score_ms,
            LAST if result.best_lap_ms is None else result.best_lap_ms,
        )
        drawn = None, 0, 0, None
    return (
        result.submitted_at,
        result.submissions,
        result.submissions,
        classified,
        result.score_ms,
        result.average_ms,
        result.best_lap_ms,
        result.total_ms,
        result.laps,
        result.off_tracks,
        result.resets,
        result.submitted_at,
        *rank,
        result.best_lap_ms if classified else None,
        *drawn,
    )


def _recorded(result: ResultRow) -> tuple:
    return (
        result.alias,
        result.rank,
        result.score,
        result.measured or result.score >= NO_SCORE,
        result.collisions,
        result.average_resets,
        result.status,
        result.division,
        list(result.blank),
    )

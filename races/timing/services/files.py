"""Laps as a CSV file: the export, and the import, all or none, with an error for each bad line."""

import csv
import io
import re
import uuid
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from django.core.exceptions import ValidationError
from django.db import transaction
from django.utils.dateparse import parse_datetime
from django.utils.timezone import get_default_timezone, is_naive, make_aware
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from accounts.models import Racer
from core.audit.recording import audited
from core.forms import explain
from core.times import clock
from paddock.errors import UserFault

from ...boards.counted_laps import counted_time
from ...boards.exports import csv_lines
from ...models import Guest, MeasuredLap, Race, Source, TimedSession
from ..selectors import sessions_of
from .checks import MOST_FAULTS, SentLap, check_time, require_may_correct
from .sessions import SentSession, carry_over

MOST_BYTES = 1_000_000
MOST_LINES = 5000
MAX_PROBLEMS = 50
NEEDED = ("lap", "time")
HEADING = (
    *("session", "started_at", "racer", "guest", "car", "model", "source", "lap", "time", "time_ms"),
    *("off_tracks", "resets", "valid", "counted_ms", "note", "corrected"),
)
_YES, _NO = ("1", "yes", "true", "valid"), ("0", "no", "false", "invalid")
_TIME = re.compile(r"^(?:(\d{1,4}):)?(\d{1,7})(?:[.,](\d{1,3}))?$")


@dataclass(frozen=True)
class LineProblem:
    """An error in a line (from 1, the heading)."""

    line: int
    fault: UserFault

    @property
    def text(self) -> str:
        """In the reader's language."""
        return _("Line %(line)s: %(problem)s") % {"line": self.line, "problem": explain(self.fault)}


class FileRefused(UserFault):
    """A rejected file, of which no lap is stored. ``problems``: at most ``MAX_PROBLEMS``, by line."""

    def __init__(self, problems: list[LineProblem]) -> None:
        super().__init__("timing_file", lines=len(problems), line=problems[0].line)
        self.problems = problems[:MAX_PROBLEMS]

    @property
    def errors(self) -> ValidationError:
        """The same for forms and the API, in the reader's language."""
        return ValidationError({"csv": [ValidationError(one.text, code=one.fault.code) for one in self.problems]})

    def __reduce__(self) -> tuple:
        return FileRefused, (self.problems,)


@dataclass(frozen=True)
class FileLap:
    """One lap of a file. ``name``: the alias, or a guest's name; ``session``: separates sessions of one name."""

    line: int
    session: str
    name: str
    is_guest: bool
    car: str
    started_at: datetime | None
    lap: SentLap

    @property
    def key(self) -> tuple[str, bool, str]:
        return self.name.lower(), self.is_guest, self.session


def read_laps(race: Race, text: str) -> list[FileLap]:
    """The laps of a CSV file with a heading; see docs/organisers.md. Raises FileRefused."""
    if len(text.encode()) > MOST_BYTES:
        raise FileRefused([LineProblem(1, UserFault("csv_too_large", most=MOST_BYTES))])
    rows = csv.reader(io.StringIO(text.lstrip("\ufeff")), strict=True)
    problems: list[LineProblem] = []
    lines: list[FileLap] = []
    try:
        heading = [name.strip().lower().replace(" ", "_") for name in next(rows, [])]
        _check_heading(heading)
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            if len(lines) + len(problems) >= MOST_LINES:
                raise UserFault("csv_too_long", most=MOST_LINES)
            try:
                lines.append(_line(race, heading, row, rows.line_num))
            except UserFault as fault:
                problems.append(LineProblem(rows.line_num, fault))
    except csv.Error:
        problems.append(LineProblem(max(1, rows.line_num), UserFault("csv_form")))
    except UserFault as fault:
        problems.append(LineProblem(max(1, rows.line_num), fault))
    if not problems and not lines:
        problems.append(LineProblem(1, UserFault("csv_empty")))
    if problems:
        raise FileRefused(problems)
    return lines


@audited("laps.imported", gettext_lazy("Laps imported from a file"), target="race")
@transaction.atomic
def take_file(*, race: Race, by: Racer, text: str, now: datetime) -> int:
    """Store the laps of a file and return their number. Taking the same file again changes nothing. Needs the right to
    correct laps. Raises FileRefused and the faults of :func:`~races.timing.services.checks.require_may_correct`; then
    no lap is stored."""
    require_may_correct(race, by, now)
    lines = read_laps(race, text)
    sessions: dict[tuple, list[FileLap]] = {}
    for line in lines:
        sessions.setdefault(line.key, []).append(line)
    problems = []
    for several in sessions.values():
        try:
            with transaction.atomic():
                _take_session(race, by, several, now)
        except UserFault as fault:
            lap = fault.params.get("lap")
            at = next((one.line for one in several if one.lap.number == lap), several[0].line)
            problems.append(LineProblem(at, fault))
    if problems:
        raise FileRefused(sorted(problems, key=lambda one: one.line))
    return len(lines)


def _take_session(race: Race, by: Racer, lines: list[FileLap], now: datetime) -> None:
    first = lines[0]
    by_number = sorted(lines, key=lambda line: line.lap.number)
    known = _known(race, first)
    if known is not None and known.source != Source.FILE:
        stored = [(lap.number, lap.time_ms, lap.off_tracks, lap.resets, lap.valid) for lap in known.laps.all()]
        in_file = [
            (one.lap.number, one.lap.time_ms, one.lap.off_tracks, one.lap.resets, one.lap.valid) for one in by_number
        ]
        if sorted(stored) != in_file:
            raise UserFault("csv_session_known", session=first.session)
        return
    id = known.pk if known else uuid.uuid5(_namespace(race), "\n".join(map(str, first.key)))
    laps = [replace(one.lap, id=uuid.uuid5(id, str(one.lap.number))) for one in by_number]
    latest = race.closes_at - timedelta(milliseconds=1)
    sent = SentSession(
        id=id,
        revision=known.revision + 1 if known else 1,
        started_at=first.started_at or max(race.opens_at, min(now, latest)),
        laps=laps,
        racer="" if first.is_guest else first.name,
        guest=(_guest(race, first.name), first.name) if first.is_guest else None,
        car=first.car,
        ended=True,
        source=Source.FILE,
        start_known=first.started_at is not None,
    )
    carry_over(race=race, by=by, sent=sent, now=now)


def _known(race: Race, line: FileLap) -> TimedSession | None:
    id = uuid.uuid5(_namespace(race), "\n".join(map(str, line.key)))
    found = TimedSession.objects.filter(race=race, pk=id).first()
    if found is None:
        try:
            found = TimedSession.objects.filter(race=race, pk=uuid.UUID(line.session)).first()
        except ValueError:
            return None
    return found


def _guest(race: Race, name: str) -> uuid.UUID:
    found = Guest.objects.filter(race=race, name__iexact=" ".join(name.split())).order_by("made_at").first()
    return found.pk if found else uuid.uuid5(_namespace(race), f"guest:{name.lower()}")


def _namespace(race: Race) -> uuid.UUID:
    return uuid.uuid5(uuid.NAMESPACE_OID, f"paddock:race:{race.pk}")


def _check_heading(heading: list[str]) -> None:
    unknown = [name for name in heading if name not in HEADING]
    missing = [name for name in NEEDED if name not in heading and not (name == "time" and "time_ms" in heading)]
    if "racer" not in heading and "guest" not in heading:
        missing.append("racer")
    if unknown or missing or len(set(heading)) < len(heading):
        raise UserFault("csv_heading", unknown=", ".join(unknown)[:200] or "–", missing=", ".join(missing) or "–")


def _line(race: Race, heading: list[str], row: list[str], line: int) -> FileLap:
    if len(row) != len(heading):
        raise UserFault("csv_cells", cells=len(row), columns=len(heading))
    cells = dict(zip(heading, (cell.strip() for cell in row), strict=True))
    number = _whole(cells, "lap", least=1, most=500)
    time_ms = _whole(cells, "time_ms", least=0, most=10**10) if cells.get("time_ms") else time_of(cells.get("time", ""))
    valid = _yes(cells.get("valid", ""))
    check_time(race, number, time_ms, valid=valid)
    racer, guest = cells.get("racer", "").removeprefix("'"), cells.get("guest", "")  # as an export guards "-alias"
    if not racer and not guest:
        raise UserFault("csv_who")
    started = cells.get("started_at", "")
    return FileLap(
        line=line,
        session=cells.get("session") or "1",
        name=guest or racer,
        is_guest=bool(guest),
        car=cells.get("car", "")[:64],
        started_at=_moment(started) if started else None,
        lap=SentLap(
            id=uuid.uuid4(),
            number=number,
            time_ms=time_ms,
            off_tracks=_whole(cells, "off_tracks", least=0, most=MOST_FAULTS, default=0),
            resets=_whole(cells, "resets", least=0, most=MOST_FAULTS, default=0),
            valid=valid,
        ),
    )


def _whole(cells: dict[str, str], name: str, *, least: int, most: int, default: int | None = None) -> int:
    text = cells.get(name, "")
    if not text and default is not None:
        return default
    if not text.isascii() or not text.isdigit() or len(text) > 12 or not least <= int(text) <= most:
        raise UserFault("csv_number", column=name, value=text[:40], least=least, most=most)
    return int(text)


def time_of(text: str) -> int:
    """``m:ss.mmm`` or ``s.mmm`` as whole milliseconds."""
    found = _TIME.match(text) if text.isascii() else None
    if found is None or (found[1] and int(found[2]) > 59):
        raise UserFault("csv_time", value=text[:40])
    return int(found[1] or 0) * 60_000 + int(found[2]) * 1000 + int((found[3] or "0").ljust(3, "0"))


def _yes(text: str) -> bool:
    if text.lower() in ("", *_YES):
        return True
    if text.lower() in _NO:
        return False
    raise UserFault("csv_valid", value=text[:40])


def _moment(text: str) -> datetime:
    try:
        found = parse_datetime(text)
    except ValueError:
        found = None
    if found is None:
        raise UserFault("csv_moment", value=text[:40])
    return make_aware(found, get_default_timezone()) if is_naive(found) else found


def lap_lines(race: Race) -> Iterator[str]:
    """Every lap, line by line, a heading first. ``counted_ms``: with penalties; empty for a lap that does not count."""
    return csv_lines(
        HEADING, (_cells(race, session, lap) for session in sessions_of(race) for lap in session.laps.all())
    )


def _cells(race: Race, session: TimedSession, lap: MeasuredLap) -> tuple:
    entry = session.entry
    return (
        session.pk,
        session.started_at.isoformat(),
        "" if entry.guest_name else entry.racer.alias,
        entry.guest_name,
        session.car,
        session.model.name if session.model else "",
        session.source,
        lap.number,
        clock(lap.time_ms),
        lap.time_ms,
        lap.off_tracks,
        lap.resets,
        lap.valid,
        counted_time(race, lap),
        lap.note,
        lap.corrected,
    )

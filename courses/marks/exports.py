"""Marks as CSV in the column forms of Moodle, Canvas and for spreadsheets.

What the readers want (their importers, November 2026): Moodle takes UTF-8 with commas, finds a student by one column of
ID numbers, user names or addresses, and reads ``-`` as no grade. It takes a row without an identifier as
one more of the row before, so such students are left out. Canvas' gradebook takes UTF-8 without a mark of the byte
order, needs "Student", "ID" and "Section", finds a student by SIS ID, then by log-in, then by the name, reads a header
that ends in a number in brackets as the id of an assignment, drops columns whose names contain words such as "Final
Score", and takes the points possible from a row of that name."""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Callable, Iterable, Sequence
from decimal import Decimal
from typing import Any

from accounts.models import RacerGroup
from races.boards.exports import plain as text

from ..assignments.students import Student
from ..assignments.wording import plain_points
from ..models import Assignment
from .table import MarkRow, assignments_of, mark_table

BYTE_ORDER_MARK = "\N{ZERO WIDTH NO-BREAK SPACE}"
_CANVAS_ID = re.compile(r"\s\((\d+)\)\Z")
_CANVAS_DROPS = re.compile(r"(Current|Final|Override) (?=Score|Points|Grade|Status)")


def plain(assignments: Sequence[Assignment]) -> bytes:
    """For a spreadsheet: parts, late days, attempts and state too. With the mark of the byte order, without which Excel
    takes another encoding."""
    tables = [(one, mark_table(one)) for one in assignments]
    header = ["Student", "Student ID", "Alias"]
    for one, _rows in tables:
        columns = [f"{part.title} ({_number(part.points)})" for part in one.parts.all()]
        columns += ["points", "points before lateness", "late days", "attempts", "state"]
        header += [text(f"{one.title}: {column}") for column in columns]

    def cells(row: MarkRow | None, parts: int) -> list[Any]:
        if row is None:
            return [""] * (parts + 5)
        mark = row.mark
        points = [_number(value) for value, _passed in row.cells]
        if mark is None:
            return [*points, "", "", "", row.attempts, row.state]
        return [*points, _number(mark.points), _number(mark.before_late), mark.late_days, row.attempts, row.state]

    lines: list[list[Any]] = [header]
    for student, rows in _by_student(tables):
        line: list[Any] = [text(student.name), text(student.student_id), text(student.racer.alias)]
        for (one, _rows), row in zip(tables, rows, strict=True):
            line += cells(row, one.parts.count())
        lines.append(line)
    return _written(lines, BYTE_ORDER_MARK)


def moodle(assignments: Sequence[Assignment]) -> bytes:
    """For Moodle's import of grades: map "Student ID" to the user, and each assignment to a grade item."""
    tables = [(one, mark_table(one)) for one in assignments]
    lines: list[list[Any]] = [["Student ID", "Full name", *(text(one.title) for one in assignments)]]
    for student, rows in _by_student(tables):
        if student.student_id:
            lines.append([text(student.student_id), text(student.name), *(_final(row) or "-" for row in rows)])
    return _written(lines)


def canvas(assignments: Sequence[Assignment]) -> bytes:
    """For Canvas' import into the gradebook."""
    tables = [(one, mark_table(one)) for one in assignments]
    titles = [text(_canvas_title(one.title)) for one in assignments]
    lines: list[list[Any]] = [["Student", "ID", "SIS User ID", "SIS Login ID", "Section", *titles]]
    full = [_number(sum((part.points for part in one.parts.all()), Decimal(0))) for one in assignments]
    lines.append(["    Points Possible", "", "", "", "", *full])
    for student, rows in _by_student(tables):
        section = text(assignments[0].group.name)
        found_by = [text(student.student_id)] * 2
        lines.append([text(student.name), "", *found_by, section, *(_final(row) for row in rows)])
    return _written(lines)


FORMS: dict[str, Callable[[Sequence[Assignment]], bytes]] = {"moodle": moodle, "canvas": canvas, "plain": plain}


def digest_of(group: RacerGroup) -> str:
    """Of all marks of a group: the same as long as none changes."""
    return hashlib.sha256(plain(assignments_of(group))).hexdigest()


def _by_student(
    tables: Iterable[tuple[Assignment, list[MarkRow]]],
) -> list[tuple[Student, list[MarkRow | None]]]:
    """Each student once, by name, with their row of each table."""
    tables = list(tables)
    students: dict[int, Student] = {}
    for _one, rows in tables:
        students |= {row.student.racer.pk: row.student for row in rows}
    found = [{row.student.racer.pk: row for row in rows} for _one, rows in tables]
    ordered = sorted(students.values(), key=lambda one: (one.name.casefold(), one.racer.pk))
    return [(one, [rows.get(one.racer.pk) for rows in found]) for one in ordered]


def _final(row: MarkRow | None) -> str:
    """The points once they are complete."""
    return _number(row.mark.points) if row is not None and row.mark is not None and row.mark.is_complete else ""


def _number(points: Decimal | None) -> str:
    """With a point, without needless zeros: every reader takes it in any language."""
    return "" if points is None else plain_points(points)


def _canvas_title(title: str) -> str:
    return _CANVAS_DROPS.sub(r"\1-", _CANVAS_ID.sub(r" [\1]", title))


def _written(lines: Iterable[Iterable[Any]], begin: str = "") -> bytes:
    out = io.StringIO()
    csv.writer(out, lineterminator="\r\n").writerows(lines)
    return f"{begin}{out.getvalue()}".encode()

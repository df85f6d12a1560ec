"""Files of marks, read by the rules of the programs that import them.

Moodle's and Canvas' rules are those of their importers (``grade/import/csv`` of Moodle, ``GradebookImporter`` of
Canvas): how they decode, split, find a student, and read a number.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from datetime import datetime
from decimal import Decimal
from typing import Any

import pytest

from accounts.class_accounts.services import add_learners, make_class
from accounts.models import ClassLearner, Classroom, Racer
from courses.attempts.services import refund_attempt
from courses.marks.exports import canvas, moodle, plain
from courses.models import Assignment, Attempt, Mark
from tests.clients import logged_in
from tests.courses.assignments import an_assignment, finish_all, hand_in
from tests.factories import a_racer, laps
from tests.kept import Kept

pytestmark = pytest.mark.django_db
NAMES = ["Kim Minji; kim@uni.example", "Ann Lee; 20262", "Bo Svensson", "Åsa Öberg; 20264", '=HYPERLINK("x"); 20265']


@pytest.fixture(scope="session")
def kept_marks(request: pytest.FixtureRequest, keep: Callable, now: datetime) -> Kept:
    return keep(request, lambda: _marks(now))


@pytest.fixture
def made(kept_marks: Kept, db: None, wakes: list[dict]) -> Assignment:
    return kept_marks.copy()


@pytest.fixture
def room(made: Assignment) -> Classroom:
    return Classroom.objects.get(group=made.group)


@pytest.fixture
def alice(made: Assignment) -> Racer:
    return Racer.objects.get(alias="alice")


def racer(room, name: str):
    return ClassLearner.objects.get(classroom=room, real_name=name).racer


def _marks(now: datetime) -> Assignment:
    """Kim has 100 points, Ann 0, the others none."""
    alice = a_racer("alice")
    room = make_class(teacher=alice, name="6a", plan=[], now=now)
    add_learners(classroom=room, by=alice, names=NAMES, now=now)
    made = an_assignment(room.group, now, title="Three laps, clean")
    finish_all(hand_in(made, racer(room, "Kim Minji"), now), laps(*[9_000] * 5), now)
    finish_all(hand_in(made, racer(room, "Ann Lee"), now), laps(9_000), now)
    return made


def read_by_moodle(content: bytes, known: dict[str, int]) -> dict[int, dict[str, Decimal | None]]:
    """Grades by user. A row whose user is unknown aborts the whole import; one without an identifier would be taken as
    another one of the user before, which this reader refuses, too."""
    text = content.decode("utf-8").removeprefix("\ufeff")
    header, *rows = csv.reader(io.StringIO(text, newline=""))
    grades: dict[int, dict[str, Decimal | None]] = {}
    for row in rows:
        assert len(row) == len(header), "weird columns"
        assert row[0], "taken as the user before"
        user = known[row[0].strip()]
        for title, value in zip(header[2:], row[2:], strict=True):
            value = value.strip()
            assert value != "", "a new grade item takes an empty text for a number"
            grade = None if value == "-" else Decimal(value.replace(" ", ""))
            assert grade is None or grade <= 100, "grades above 100 are refused"
            grades.setdefault(user, {})[title.strip()] = grade
    return grades


class Canvas:
    """What Canvas takes from a file: students by SIS ID, by log-in, by name; assignments by title or id."""

    def __init__(self, content: bytes, *, sis: dict[str, int], names: dict[str, int], assignments: dict[int, str]):
        text = content.decode("utf-8")
        assert not text.startswith("\ufeff"), "the first heading would be another"
        first = text.splitlines()[:3]
        counts = {mark: [len(next(csv.reader([line], delimiter=mark))) for line in first] for mark in ";,"}
        fields = {mark: found[0] if len(set(found)) == 1 else 0 for mark, found in counts.items()}
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=";" if fields[";"] > fields[","] else ","))
        header = rows[0]
        assert len(header) > 3 and "Student" in header[0] and "ID" in header[1], "invalid header row"
        assert re.search(r"SIS\s+User\s+ID", header[2]) and re.search(r"SIS\s+Login\s+ID", header[3])
        assert "Section" in header[4]
        dropped = re.compile("|".join(f"{a} {b}" for a in ("Current", "Final") for b in ("Score", "Points", "Grade")))
        self.possible: dict[str, str] = {}
        self.grades: dict[int, dict[str, str]] = {}
        columns: dict[int, str] = {}
        for at, title in enumerate(header[5:], 5):
            if not dropped.search(title):
                found = re.fullmatch(r"(.*)\s\((\d+)\)", title)
                columns[at] = assignments.get(int(found[2]), found[1]) if found else title
        self.titles = list(columns.values())
        for row in rows[1:]:
            if "Points Possible" in row[0]:
                self.possible = {title: row[at] for at, title in columns.items()}
                continue
            assert not row[1] or row[1].isdigit()
            user = sis.get(row[2]) or sis.get(row[3]) or names[row[0]]
            self.grades[user] = {title: self._number(row[at].strip()) for at, title in columns.items()}

    @staticmethod
    def _number(field: str) -> str:
        if not re.fullmatch(r"-?[0-9.,]+%?", field):
            return field
        *parts, last = re.split(r"[,.]", field)
        return f"{''.join(parts)}.{last}" if parts else last


def test_moodle_reads_its_file(made):
    known = {"kim@uni.example": 1, "20262": 2, "20264": 4, "20265": 5}
    file = moodle([made])
    grades = read_by_moodle(file, known)
    assert grades[1] == {"Three laps, clean": Decimal(100)} and grades[2] == {"Three laps, clean": Decimal(0)}
    assert grades[4] == {"Three laps, clean": None}
    assert "Bo Svensson" not in file.decode() and set(grades) == {1, 2, 4, 5}


def test_canvas_reads_its_file(made):
    sis = {"kim@uni.example": 1, "20262": 2, "20264": 4, "20265": 5}
    read = Canvas(canvas([made]), sis=sis, names={"Bo Svensson": 3}, assignments={})
    assert read.titles == ["Three laps, clean"] and read.possible == {"Three laps, clean": "100"}
    assert {user: one["Three laps, clean"] for user, one in read.grades.items()} == {
        1: "100",
        2: "0",
        3: "",
        4: "",
        5: "",
    }


@pytest.mark.parametrize("title", ["Race (2026)", "Final Score of the year", "Current Points", "a; b, c", "Über 10 %"])
def test_canvas_takes_any_title_for_a_new_assignment(made, title):
    Assignment.objects.filter(pk=made.pk).update(title=title)
    made.refresh_from_db()
    names = {"Bo Svensson": 3}
    sis = {"kim@uni.example": 1, "20262": 2, "20264": 4, "20265": 5}
    read = Canvas(canvas([made]), sis=sis, names=names, assignments={2026: "of somebody else"})
    assert len(read.titles) == 1 and read.titles != ["of somebody else"]
    assert next(iter(read.grades[1].values())) == "100"


def test_a_sheet_gets_parts_days_and_states_and_knows_the_encoding(made):
    content = plain([made])
    assert content.startswith(b"\xef\xbb\xbf"), "Excel takes another encoding without it"
    rows = list(csv.DictReader(io.StringIO(content.decode("utf-8-sig"), newline="")))
    kim = next(row for row in rows if row["Student"] == "Kim Minji")
    assert kim["Student ID"] == "kim@uni.example" and kim["Three laps, clean: points"] == "100"
    assert kim["Three laps, clean: Laps (100)"] == "100" and kim["Three laps, clean: late days"] == "0"
    assert kim["Three laps, clean: state"] == "passed" and kim["Three laps, clean: attempts"] == "1"
    assert {row["Student"] for row in rows} >= {"Åsa Öberg", "Bo Svensson"}


@pytest.mark.parametrize("form", [moodle, canvas, plain])
def test_no_cell_is_a_formula(made, form):
    Assignment.objects.filter(pk=made.pk).update(title="=1+1")
    made.refresh_from_db()
    cells = [cell for row in csv.reader(io.StringIO(form([made]).decode("utf-8-sig"), newline="")) for cell in row]
    assert any("HYPERLINK" in cell for cell in cells)
    assert not [cell for cell in cells if cell[:1] in ("=", "+", "@", "\t") or (cell[:1] == "-" and cell != "-")]


def test_points_of_a_run_that_waits_are_not_exported(room, made, now):
    finish_all(hand_in(made, racer(room, "Bo Svensson"), now), laps(*[9_000] * 5), now)
    waits = hand_in(made, racer(room, "Kim Minji"), now)
    mark = Mark.objects.get(assignment=made, racer=racer(room, "Kim Minji"))
    assert mark.points == 100 and not mark.is_complete
    grades = read_by_moodle(moodle([made]), {"kim@uni.example": 1, "20262": 2, "20264": 4, "20265": 5})
    assert grades[1] == {"Three laps, clean": None}
    refund_attempt(attempt=waits, by=made.group.leader, reason="Queue", now=now)
    grades = read_by_moodle(moodle([made]), {"kim@uni.example": 1, "20262": 2, "20264": 4, "20265": 5})
    assert grades[1] == {"Three laps, clean": Decimal(100)}


def test_no_zero_is_exported_while_a_first_attempt_may_come(room, made, now):
    """A mark that is left without an attempt is one of a regrade, or after the attempt was given back."""
    ann = racer(room, "Ann Lee")
    refund_attempt(attempt=Attempt.objects.get(racer=ann), by=made.group.leader, reason="Queue", now=now)
    known = {"kim@uni.example": 1, "20262": 2, "20264": 4, "20265": 5}
    assert read_by_moodle(moodle([made]), known)[2] == {"Three laps, clean": None}
    Assignment.objects.filter(pk=made.pk).update(final_at=now)
    made.refresh_from_db()
    assert read_by_moodle(moodle([made]), known)[2] == {"Three laps, clean": Decimal(0)}


def test_decimals_are_the_same_in_every_language(made, room, alice):
    Mark.objects.filter(assignment=made, racer=racer(room, "Kim Minji")).update(points="37.50")
    for language in ("en", "ko"):
        client: Any = logged_in(alice)
        client.cookies["django_language"] = language
        answer = client.get(f"/assignments/{made.public_id}/marks.csv?form=moodle")
        assert answer["Content-Type"] == "text/csv; charset=utf-8" and "37.5\r\n" in answer.content.decode()
    assert logged_in(alice).get(f"/assignments/{made.public_id}/marks.csv?form=xml").status_code == 404

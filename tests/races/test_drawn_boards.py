"""Lines of boards: drawn again when they change, and what is for one racer within them."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import pytest
from django.utils import timezone

from accounts.models import Racer
from core.streams import shared_pieces
from races.boards.drawn_boards import DrawnBoard, drawn_board
from races.models import Entry, Race
from tests.factories import a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db


@pytest.fixture
def clock(now: datetime, monkeypatch: pytest.MonkeyPatch) -> list[datetime]:
    """The time of the pages, which a test moves."""
    times = [now]
    monkeypatch.setattr(timezone, "now", lambda: times[-1])
    return times


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The racers whose lines were drawn since the test looked."""
    found: list[str] = []
    real = shared_pieces.render_to_string

    def draw(template: str, values: Any) -> Any:
        if template == "races/boards/line.html":
            found.append(values["row"].alias)
        return real(template, values)

    monkeypatch.setattr(shared_pieces, "render_to_string", draw)
    monkeypatch.setattr(shared_pieces, "_lasting_pieces", shared_pieces._Lasting(100))
    return found


@pytest.fixture
def race(now: datetime, clock: list[datetime]) -> Race:
    race = a_race(now - timedelta(days=1), slug="busy")
    for number, alias in enumerate(("alice", "bob", "carol")):
        drive(race, a_racer(alias), laps(10_000 + number, 10_100, 10_200), now)
    return race


def look(drawn: list[str]) -> tuple[list[str], DrawnBoard]:
    drawn.clear()
    board = drawn_board("busy", 1, None)
    return list(drawn), board


def test_lines_that_stay_the_same_are_drawn_once(race: Race, drawn: list[str]) -> None:
    assert look(drawn)[0] == ["alice", "bob", "carol"]
    first = look(drawn)
    assert first[0] == []
    drive(race, a_racer("dave"), laps(10_900, 10_900, 10_900), timezone.now())
    again = look(drawn)
    assert again[0] == ["dave"]
    assert "/racers/dave/" in again[1].lines.html and "/racers/dave/" not in first[1].lines.html


def test_a_line_is_drawn_again_when_its_result_is_a_minute_older(
    race: Race, drawn: list[str], clock: list[datetime]
) -> None:
    assert "just now" in look(drawn)[1].lines.html
    for minutes in (1, 2):
        clock.append(clock[0] + timedelta(minutes=minutes))
        names, board = look(drawn)
        assert len(names) == 3 and f"{minutes} min ago" in board.lines.html


@pytest.mark.parametrize(
    "change",
    [
        lambda: Racer.objects.filter(alias="bob").update(alias="robert"),
        lambda: Racer.objects.filter(alias="bob").update(country="KR"),
        lambda: Entry.objects.filter(racer__alias="bob").update(
            car_of=Entry.objects.get(racer__alias="alice"),
        ),
    ],
)
def test_a_line_shows_what_has_changed(race: Race, drawn: list[str], change: Any) -> None:
    bob = Entry.objects.get(racer__alias="bob").pk
    look(drawn)
    change()
    named = Entry.objects.get(pk=bob).racer.alias
    behind = ["carol"] if named != "bob" else []  # her line names the car ahead
    assert look(drawn)[0] == [named, *behind]


def test_another_race_rule_draws_all_lines_again(race: Race, drawn: list[str]) -> None:
    look(drawn)
    Race.objects.filter(pk=race.pk).update(ranking_method="best")
    assert len(look(drawn)[0]) == 3


def test_each_racer_gets_their_own_line_marked(race: Race, drawn: list[str]) -> None:
    lines = look(drawn)[1].lines
    racers = list(Racer.objects.filter(entries__race=race))
    assert len(racers) == 3
    for racer in racers:
        html = lines.for_reader(racer.pk)
        assert html.count('aria-current="true"') == html.count("linked me") == html.count('"tag you"') == 1
        row = html[html.index("linked me") :]
        assert f"/racers/{racer.alias}/" in row[: row.index("</tr>")]
    assert "linked me" not in lines.html and '"tag you"' not in lines.for_reader(a_racer().pk)

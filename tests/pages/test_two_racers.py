"""A race's page for several racers at once: shared parts, no piece of another racer, few queries."""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import pytest
from django.db import connection
from django.template import Context, Engine
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from accounts.models import GroupMember, Racer, RacerGroup
from benchmarks.board_rows import counted_at_the_end, fill, make_racers
from core.streams import shared_pieces
from races.entries.services.submissions import submit_model
from races.models import Race
from tests.factories import a_model, a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db(transaction=True)
MOST_QUERIES = 8
PARTS = ("", "?page=2", "rules/", "runs/", "live/")


@dataclass
class Reader:
    """A racer, and the texts that only their pages have."""

    racer: Racer
    own: tuple[str, ...]

    def client(self) -> Client:
        client = Client()
        client.force_login(self.racer)
        return client


@pytest.fixture(autouse=True)
def shared_for_long(settings, monkeypatch, wakes):
    settings.SHARED_PAGE_SECONDS = 3600  # so that no part gets too old within a slow test
    monkeypatch.setattr(shared_pieces, "LIVES_S", 3600.0)
    monkeypatch.setattr(shared_pieces, "_newest", shared_pieces._Newest())
    monkeypatch.setattr(shared_pieces, "_parts", shared_pieces.Unchanged(shared_pieces.PARTS))


@pytest.fixture
def race() -> Race:
    return a_race(timezone.now(), slug="busy", name="Busy race")


@pytest.fixture
def readers(race: Race) -> list[Reader]:
    """A racer with a result on the first page, one whose car waits, one with a row far down, one without a car."""
    now = timezone.now()
    with counted_at_the_end():
        make_racers(60, now)
        fill(race, 60, now)
    first, waits, last, new = (a_racer(f"reader-{name}") for name in ("first", "waits", "last", "new"))
    drive(race, first, laps(5_000, 5_001, 5_002), now)
    drive(race, last, laps(110_000, 110_001, 110_002), now)
    waiting = submit_model(race=race, racer=waits, model=a_model(waits, name="car-of-waits"), now=now)
    for racer in (first, last):
        a_model(racer, name=f"spare-of-{racer.alias}")
    group = RacerGroup.objects.create(leader=first, name="Circle of the first", slug="circle", made_at=now)
    GroupMember.objects.create(group=group, racer=first, asked_at=now, confirmed_at=now, confirmed_by=first)
    return [
        Reader(first, ("spare-of-reader-first", "Circle of the first")),
        Reader(waits, ("car-of-waits", waiting.evaluation.get_absolute_url())),
        Reader(last, ("spare-of-reader-last",)),
        Reader(new, ("Train my first car",)),
    ]


def check_page(html: str, part: str, reader: Reader, readers: list[Reader]) -> None:
    """The page has the reader's pieces, and none of the others'."""
    for other in readers:
        if other is not reader:
            found = [text for text in (*other.own, f"<summary>{other.racer.alias}<") if text in html]
            assert not found, (part, reader.racer.alias, found)
    mine = re.findall(r'<tr class="linked me.*?</tr>', html, re.DOTALL)
    if part in ("", "?page=2"):
        assert all(text in html for text in reader.own), (part, reader.racer.alias)
        assert len(mine) == (reader.racer.alias != "reader-new"), (part, reader.racer.alias)
    if part != "live/":
        assert f"<summary>{reader.racer.alias}<" in html
    assert all(f">{reader.racer.alias}</a>" in row for row in mine if part != "runs/")


def read(client: Client, part: str) -> str:
    answer = client.get(f"/races/busy/{part}")
    assert answer.status_code == 200
    return answer.content.decode()


def test_racers_in_turn_see_their_own_pieces_only(readers):
    clients = [(reader, reader.client()) for reader in readers]
    for _ in range(2):
        for part in PARTS:
            for reader, client in clients:
                check_page(read(client, part), part, reader, readers)


@pytest.mark.parametrize("rounds", [10, pytest.param(250, marks=pytest.mark.slow)])
def test_racers_at_once_see_their_own_pieces_only(readers, rounds):
    """Each racer in a thread, half of the time with parts that are made anew."""

    def look(reader: Reader) -> None:
        client = reader.client()
        try:
            for number in range(rounds):
                part = PARTS[number % len(PARTS)]
                if number % 2:
                    client.cookies["wrote"] = "1"
                else:
                    client.cookies.pop("wrote", None)
                check_page(read(client, part), part, reader, readers)
        finally:
            connection.close()

    with ThreadPoolExecutor(len(readers)) as threads:
        list(threads.map(look, readers))


@pytest.mark.parametrize("part", PARTS)
def test_a_page_of_a_race_needs_few_queries(readers, part):
    for reader in readers:
        client = reader.client()
        read(client, part)
        sent = queries(lambda: read(client, part))  # noqa: B023 — called at once
        assert len(sent) <= MOST_QUERIES, "\n".join([reader.racer.alias, *sent])


def test_more_rows_need_no_more_queries(race, readers):
    client = readers[0].client()
    read(client, "")
    before = len(queries(lambda: read(client, "")))
    for number in range(4):
        drive(race, a_racer(), laps(6_000 + number, 6_000, 6_000), timezone.now())
        a_model(readers[0].racer)
    read(client, "")
    assert len(queries(lambda: read(client, ""))) <= before


def queries(call: Callable[[], object]) -> list[str]:
    with CaptureQueriesContext(connection) as captured:
        call()
    return [query["sql"] for query in captured]


def test_a_shared_part_of_a_race_takes_nothing_of_a_reader(race, readers):
    template = Engine.get_default().from_string('{% load boards %}{% race_piece "races/web/tabs.html" tab=value %}')
    assert "<nav" in template.render(Context({"race": race, "value": "board"}))
    with pytest.raises(AssertionError):
        template.render(Context({"race": race, "value": readers[0].racer}))

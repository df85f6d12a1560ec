"""Parts that all readers share: made once a position, and never behind what their reader did or saw."""

from __future__ import annotations

import threading

import pytest
from django.db import transaction
from django.test import Client
from django.urls import reverse
from django.utils import timezone, translation
from django.utils.safestring import mark_safe
from django.utils.translation import gettext

from core.streams import reading, shared_pieces
from core.streams.shared_pieces import (
    MarkedPiece,
    filled,
    hole,
    lasting_piece,
    lasting_value,
    marked,
    reading_since,
    shared_piece,
    shared_value,
    shown_position,
)
from races.events import record_board
from races.models import Race
from tests.factories import a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture(autouse=True)
def one_second(settings, monkeypatch):
    settings.SHARED_PAGE_SECONDS = 3600  # so that no part gets too old within a slow test
    monkeypatch.setattr(shared_pieces, "LIVES_S", 3600.0)
    monkeypatch.setattr(shared_pieces, "_newest", shared_pieces._Newest())


@pytest.fixture
def race() -> Race:
    return a_race(timezone.now())


def rename(race: Race, name: str) -> None:
    """Commit a change, as another program does."""
    Race.objects.filter(pk=race.pk).update(name=name)


def name_of(race: Race) -> str:
    return shared_value(("name", race.pk), lambda: Race.objects.get(pk=race.pk).name)


def test_a_lasting_value_is_made_once_a_language_whatever_is_committed(race, monkeypatch):
    monkeypatch.setattr(shared_pieces, "_lasting", shared_pieces._Lasting(40))
    made = []

    def value(key: object) -> str:
        return lasting_value(key, lambda: made.append(key) or gettext("Races"))

    first = value("a")
    rename(race, "Second")
    assert value("a") == first
    with translation.override("ko"):
        assert value("a") != first
    assert made == ["a", "a"]


def test_a_transaction_neither_gets_nor_leaves_a_lasting_value(monkeypatch):
    monkeypatch.setattr(shared_pieces, "_lasting", shared_pieces._Lasting(40))
    with transaction.atomic():
        assert lasting_value("a", lambda: "own") == "own"
    assert lasting_value("a", lambda: "all") == "all"
    with transaction.atomic():
        assert lasting_value("a", lambda: "own") == "own"


def test_the_lasting_value_used_longest_ago_makes_way(monkeypatch):
    monkeypatch.setattr(shared_pieces, "_lasting", shared_pieces._Lasting(2))
    for key in ("a", "b", "a", "c"):
        lasting_value(key, lambda: "old")
    assert [lasting_value(key, lambda: "new") for key in ("a", "c", "b")] == ["old", "old", "new"]


def test_a_lasting_piece_is_drawn_once_for_the_values_of_its_key_and_the_language(monkeypatch):
    monkeypatch.setattr(shared_pieces, "_lasting_pieces", shared_pieces._Lasting(40))

    def pager(number: int, key: object) -> str:
        return lasting_piece("parts/pages.html", {"number": number, "pages": 9, "others": "?"}, key=key)

    first = pager(2, "second")
    assert "Page 2 of 9" in first and pager(3, "second") == first
    assert "Page 3 of 9" in pager(3, "third")
    with translation.override("ko"):
        assert pager(2, "second") != first


def test_a_part_is_made_once_a_position_however_much_is_committed(race):
    with reading_since(0):
        first = name_of(race)
        rename(race, "Second")
        assert name_of(race) == first


def test_a_part_is_never_older_than_a_request_that_must_be_fresh(race):
    with reading_since(0):
        name_of(race)
    rename(race, "Second")
    with reading_since(None):
        assert name_of(race) == "Second"


def test_a_part_is_as_new_as_the_event_that_its_reader_saw(race):
    with reading_since(0):
        name_of(race)
    rename(race, "Second")
    record_board(race)
    with reading_since(reading.newest()):
        assert name_of(race) == "Second"


def test_the_position_of_a_page_is_not_ahead_of_its_parts(race):
    """Otherwise the page would never ask for what its parts lack."""
    with reading_since(0):
        before = shown_position()
        first = name_of(race)
        rename(race, "Second")
        record_board(race)
        assert reading.newest() > before
        assert (name_of(race), shown_position()) == (first, before)


def test_an_invented_position_makes_no_part_anew_and_is_not_shown(race):
    with reading_since(0):
        first = name_of(race)
    rename(race, "Second")
    with reading_since(10**18):
        assert name_of(race) == first
        assert shown_position() == reading.last_numbered()


def test_a_part_made_anew_has_no_old_parts_inside(race):
    def outer() -> str:
        return shared_value("outer", lambda: f"In {name_of(race)}")

    with reading_since(0):
        name_of(race)
        rename(race, "Second")
        assert outer() == "In Second"


def test_a_transaction_gets_its_own_changes(race):
    with reading_since(0):
        name_of(race)
        with transaction.atomic():
            rename(race, "Second")
            assert name_of(race) == "Second"


def test_a_setting_of_zero_shares_nothing_across_a_commit(race, settings):
    settings.SHARED_PAGE_SECONDS = 0
    with reading_since(0):
        name_of(race)
        rename(race, "Second")
        assert name_of(race) == "Second"


def test_readers_who_come_at_once_wait_for_one_part(race):
    made, results = [], []

    def read() -> None:
        with reading_since(0):
            results.append(shared_value("slow", lambda: made.append(1) or len(made)))

    readers = [threading.Thread(target=read) for _ in range(8)]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
    assert (made, results) == ([1], [1] * 8)


def test_a_piece_has_no_reader_and_one_form_for_each_language():
    with reading_since(0):
        pieces = {
            language: piece
            for language in ("en", "ko")
            for _ in [translation.activate(language)]
            for piece in [shared_piece("404.html", dict, key=())]
        }
    translation.activate("en")
    assert pieces["en"] != pieces["ko"]
    assert "csrfmiddlewaretoken" not in pieces["en"]


def test_a_reader_who_has_just_changed_something_gets_the_last_commit(race):
    """Also while others get pages from before it."""
    writer, other, at = Client(), Client(), race.get_absolute_url()
    for _ in range(2):  # the first shows which query parameters the view reads
        other.get(at)
    cookie = writer.post("/theme/", {"theme": ""}).cookies["wrote"]
    assert (cookie["httponly"], cookie["samesite"], cookie["path"]) == (True, "Lax", "/")
    rename(race, "Second")
    assert "Second" not in other.get(at).content.decode()
    assert "Second" in writer.get(at).content.decode()


@pytest.mark.parametrize("headers", [{"HX-Request": "true"}, {"Sec-Fetch-Mode": "cors"}])
def test_a_script_gets_the_last_commit(race, headers):
    """It asks because something has changed, and may not ask again."""
    client, at = Client(headers=headers), race.get_absolute_url()
    for _ in range(2):
        client.get(at)
    rename(race, "Second")
    assert "Second" in client.get(at).content.decode()


def test_a_program_gets_the_last_commit(race, wakes):
    """It has no cookie that says what it has changed."""
    client, at = Client(), f"/api/v1/races/{race.slug}/board/"
    assert client.get(at).json()["count"] == 0
    drive(race, a_racer("alice"), laps(9_000, 9_000, 9_000), timezone.now())
    assert client.get(at).json()["count"] == 1


def test_a_value_with_a_text_has_one_form_for_each_language():
    with reading_since(0):
        texts = []
        for language in ("en", "ko"):
            with translation.override(language):
                texts.append(shared_value("text", lambda: gettext("Races")))
    assert texts[0] != texts[1]


def test_a_refused_change_and_a_program_set_no_cookie():
    login = reverse("account_login")
    assert Client(enforce_csrf_checks=True).post(login).status_code == 403
    assert "wrote" not in Client(enforce_csrf_checks=True).post(login).cookies
    assert "wrote" not in Client().post("/theme/", {"theme": "dark"}, headers={"Authorization": "Bearer x"}).cookies


def test_a_hole_is_filled_for_each_reader_and_not_by_a_text_that_looks_like_one():
    piece = mark_safe(f"<p>{hole('car')}</p>[car] {hole('car')}")
    looks_like_one = mark_safe("[car] \\1")
    assert [filled(piece, car=car) for car in (mark_safe("mine"), looks_like_one)] == [
        "<p>mine</p>[car] mine",
        "<p>[car] \\1</p>[car] [car] \\1",
    ]


def test_a_marked_piece_has_for_each_reader_what_is_theirs_alone():
    piece = MarkedPiece.read(f"<p>{marked(7, ' seven')}-{marked(8, ' eight')}-{marked(7, '!')}</p>")
    assert [piece.for_reader(reader) for reader in (None, 9, 7, 8)] == [
        "<p>--</p>",
        "<p>--</p>",
        "<p> seven--!</p>",
        "<p>- eight-</p>",
    ]


def test_a_text_that_looks_like_a_mark_is_a_text():
    invented = marked(7, "mine").replace(shared_pieces._TOKEN, "0" * 32)
    assert MarkedPiece.read(invented).for_reader(7) == invented

"""Pages that guests share: made once, never older than the database, and nobody else's."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from django.db import transaction
from django.test import Client
from django.utils import timezone

from config.middleware import shared_pages as guests
from core.streams.reading import newest
from league.home import views as home_page
from races.boards.selectors.shared_boards import shared_board
from races.events import record_board
from races.models import Race, Visibility
from races.pages.views import races as race_pages
from tests.factories import a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def race(now) -> Race:
    return a_race(now, name="Cached race")


@pytest.fixture(autouse=True)
def long_lived(monkeypatch) -> None:
    """A page does not end by itself while a test runs: what changes it must be the database."""
    monkeypatch.setattr(guests, "LIVES_S", 3600.0)


@pytest.fixture
def made(monkeypatch) -> list[str]:
    """The paths of the pages that were made."""
    paths: list[str] = []
    for module in (home_page, race_pages):
        monkeypatch.setattr(module, "render", _noting(module.render, paths))
    return paths


def _noting(render: Callable, paths: list[str]) -> Callable:
    def noted(request, *args, **kwargs):
        paths.append(request.path)
        return render(request, *args, **kwargs)

    return noted


def test_a_board_is_rendered_once_for_all_guests(race, made):
    client = Client()  # the pages are kept by a site: each client has one of its own
    at = race.get_absolute_url()
    client.get(at)  # shows which query parameters the view reads
    made.clear()
    answers = [client.get(at) for _ in range(3)]
    assert made == [at]
    assert {answer.content for answer in answers} == {answers[0].content}
    for answer in answers:
        assert answer.status_code == 200 and not answer.cookies and not client.cookies
        assert {"Cookie", "Accept-Language", "HX-Request"} <= {word.strip() for word in answer["Vary"].split(",")}
        assert answer["Cache-Control"] == "private, no-cache"
    unchanged = client.get(at, headers={"If-None-Match": answers[0]["ETag"]})
    assert (unchanged.status_code, unchanged.content) == (304, b"")


def test_pages_that_know_of_an_event_share_one_that_was_begun_after_it(race, made):
    """Also while workers commit all the time, and whatever number somebody makes up."""
    client, at = Client(), race.get_absolute_url()

    def asked(number: int) -> int:
        Race.objects.filter(pk=race.pk).update(description=f"Commit before {len(made)} {number}")
        client.get(at, headers={"X-Paddock-Parts": "1", "X-Paddock-At": str(number)})
        return len(made)

    client.get(at)  # shows which query parameters the view reads
    made.clear()
    record_board(race)
    first = newest()
    assert [asked(first) for _ in range(3)] == [1, 1, 1]
    assert asked(first + 1) == 1, "there is no such event"
    record_board(race)
    second = newest()
    assert [asked(second) for _ in range(3)] == [2, 2, 2]
    assert asked(first) == 2, "an older position is met by a newer page"
    client.get(at)
    assert len(made) == 3, "without a position, the page has the last commit"


def test_a_changed_board_is_rendered_again_immediately(race, made, now, wakes):
    client, at = Client(), race.get_absolute_url()
    before = client.get(at)
    drive(race, a_racer("newcomer"), laps(9000, 9100, 9200), now)
    after = client.get(at, headers={"If-None-Match": before["ETag"]})
    assert after.status_code == 200
    assert b"newcomer" in after.content and b"newcomer" not in before.content


@pytest.mark.parametrize("how", [{"visibility": Visibility.INVITATION}, {"name": "Another name"}])
def test_a_withdrawn_race_disappears_from_cached_pages(race, how):
    client, other = Client(), Client()
    assert b"Cached race" in client.get("/").content
    Race.objects.filter(pk=race.pk).update(**how)
    assert b"Cached race" not in client.get("/").content
    assert b"Cached race" not in other.get("/").content


def test_an_uncommitted_change_is_neither_shown_nor_cached(race):
    client = Client()
    with pytest.raises(RuntimeError), transaction.atomic():
        Race.objects.filter(pk=race.pk).update(name="Never was")
        client.get("/")
        raise RuntimeError
    assert b"Never was" not in client.get("/").content


def test_a_private_race_is_never_cached_for_guests(now, made):
    owner, stranger = a_racer("owner"), a_racer("stranger")
    steward = a_racer("steward", is_staff=True, is_superuser=True)
    private = a_race(now, name="Secret race", visibility=Visibility.INVITATION, organiser=owner)
    at, guest = private.get_absolute_url(), Client()
    seen = {}
    for name, client in (("guest", guest), ("stranger", _client(stranger)), ("owner", _client(owner)),
                         ("steward", _client(steward)), ("guest again", guest)):  # fmt: skip
        seen[name] = client.get(at).status_code
        assert (b"Secret race" in client.get("/").content) <= (name in ("owner", "steward")), name
    assert seen == {"guest": 404, "stranger": 404, "owner": 200, "steward": 200, "guest again": 404}


def test_a_logged_in_racers_page_is_not_cached(race, made):
    alice = a_racer("alice")
    guest, racer = Client(), _client(alice)
    at = race.get_absolute_url()
    for client in (guest, racer, guest, racer):
        assert (b"alice" in client.get(at).content) == (client is racer)
    assert len(made) >= 3, "the racer's each time"


def test_each_language_and_theme_is_cached_separately(race):
    client = Client()
    english = client.get("/").content
    korean = client.get("/", headers={"Accept-Language": "ko"}).content
    assert b'lang="en"' in english and b'<html lang="ko"' in korean
    client.post("/i18n/setlang/", {"language": "ko", "next": "/"})
    assert client.get("/").content == korean
    client.post("/theme/", {"theme": "dark", "next": "/"})
    assert b'data-theme="dark"' in client.get("/").content
    assert client.get("/?show=closed").content != korean, "the address is in the links of the page"


def test_a_cached_page_expires_with_its_times(race, made, monkeypatch):
    monkeypatch.setattr(guests, "LIVES_S", 0.0)
    client = Client()
    client.get("/")
    client.get("/")
    assert made == ["/", "/"]


def test_a_racer_sees_the_shared_board_with_their_own_row(race, now, wakes):
    alice, bob = a_racer("alice"), a_racer("bob")
    for place, racer in enumerate((alice, bob, a_racer("carol"))):
        drive(race, racer, laps(*(9000 + 100 * place + n for n in range(3))), now)
    at, clients = race.get_absolute_url(), {"alice": _client(alice), "bob": _client(bob), "guest": Client()}
    for _ in range(2):
        for name, client in clients.items():
            page = client.get(at).content.decode()
            rows = re.findall(r'<tr class="linked([^"]*)".*?</tr>', page, re.DOTALL)
            mine = [row for row in re.findall(r"<tr.*?</tr>", page, re.DOTALL) if 'aria-current="true"' in row]
            assert len(rows) == 3
            assert len(mine) == (0 if name == "guest" else 1)
            assert all(f">{name}</a>" in row for row in mine)
    korean = clients["alice"].get(at, headers={"Accept-Language": "ko"}).content.decode()
    assert "Watch the run" not in korean, "a row in another language is another row"


def test_a_racer_on_a_later_page_sees_their_row_beside_the_board(race, now, wakes, monkeypatch):
    racers = [a_racer(f"racer-{number}") for number in range(4)]
    for place, racer in enumerate(racers):
        drive(race, racer, laps(*(9000 + 100 * place + n for n in range(3))), now)
    first = shared_board(race, racers[0], page=1, per_page=2)
    last = shared_board(race, racers[3], page=1, per_page=2)
    assert (first.my_row.rank, first.my_row_is_elsewhere) == (1, False)
    assert (last.my_row.rank, last.my_row_is_elsewhere) == (4, True)
    assert [row.entry.pk for row in first.rows] == [row.entry.pk for row in last.rows]
    assert not any(row.is_me for row in last.rows)


@pytest.mark.soak
@pytest.mark.postgres
def test_the_same_on_postgresql(again_on_postgresql):
    again_on_postgresql(f"{__file__}", "tests/evaluation/test_unchanged.py", "-k", "not postgresql")


def _client(racer) -> Client:
    client = Client()
    client.force_login(racer)
    return client

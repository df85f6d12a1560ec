"""Every page that guests share: it keeps the Cache-Control of its view, and depends on nothing outside its key."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import Any

import pytest
from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.test import Client, override_settings
from django.urls import URLPattern, URLResolver, get_resolver, path, reverse
from django.utils import timezone

from config import urls as site
from config.middleware import shared_pages as guests
from config.middleware.page_etags import tag_of
from evaluation.models import Evaluation
from league.seasons.services.demo_season import open_demo_season
from tests.duels import drawn
from tests.factories import a_racer
from tests.live_shows import a_live_race, a_show, begun

pytestmark = pytest.mark.django_db(transaction=True)
WITHOUT = [name for name in settings.MIDDLEWARE if name != "config.middleware.shared_pages.SharedPages"]
# What a browser or a proxy may send beside what the key holds
OTHERS: list[dict[str, str]] = [
    {"User-Agent": "Another/1.0"},
    {"Referer": "http://testserver/races/"},
    {"X-Forwarded-For": "192.0.2.7"},
    {"X-Forwarded-Host": "elsewhere.example.org"},
    {"X-Paddock-Parts": "1"},
    {"Accept": "application/json"},
    {"Cookie": "other=1; zone=Asia/Seoul"},
    {"HX-Request": "true", "HX-Current-URL": "http://testserver/about/"},
    {"HX-Request": "true", "HX-Request-URI-AutoEncoded": "true"},
    {"Range": "bytes=0-9"},
]


def view_of(read: Callable[[HttpRequest], Any], **headers: str) -> Callable[..., HttpResponse]:
    def view(request: HttpRequest, **kwargs: Any) -> HttpResponse:
        return HttpResponse(str(read(request)), headers=headers)

    return view


def _with_session(request: HttpRequest) -> str:
    request.session["seen"] = True
    return "seen"


READS = {
    "meta": lambda request: request.META.get("HTTP_USER_AGENT"),
    "meta-item": lambda request: request.META["HTTP_USER_AGENT"],
    "meta-has": lambda request: "HTTP_X_EXTRA" in request.META,
    "meta-all": lambda request: sorted((key, str(value)) for key, value in request.META.items() if key[:4] == "HTTP"),
    "meta-copy": lambda request: dict(request.META)["HTTP_USER_AGENT"],
    "environ": lambda request: request.environ.get("HTTP_USER_AGENT"),
    "headers": lambda request: request.headers.get("User-Agent"),
    "headers-has": lambda request: "X-Extra" in request.headers,
    "headers-all": lambda request: sorted(dict(request.headers).items()),
    "accepts": lambda request: request.accepts("application/json"),
    "language": lambda request: request.headers["Accept-Language"],
    "address": lambda request: request.META["REMOTE_ADDR"],
    "cookie": lambda request: request.COOKIES.get("other"),
    "cookie-all": lambda request: sorted(request.COOKIES.items()),
    "cookie-header": lambda request: request.META.get("HTTP_COOKIE"),
}
KEPT = ("no-store", "private", "private, no-store", "no-cache, no-store, must-revalidate", "public, max-age=60")
_made: list[str] = []


def _counted(request: HttpRequest) -> str:
    _made.append(request.GET.get("page", "1"))
    return f"page {request.GET.get('page', '1')}, back to {request.get_full_path()}"


QUERIES = {
    "item": lambda request: request.GET["seen"],
    "has": lambda request: "seen" in request.GET,
    "list": lambda request: request.GET.getlist("seen"),
    "all": lambda request: sorted(request.GET.items()),
    "dict": lambda request: request.GET.dict(),
    "pairs": lambda request: list(request.GET.lists()),
    "copy": lambda request: request.GET.copy().get("seen"),
    "length": lambda request: len(request.GET),
    "any": lambda request: bool(request.GET),
    "equal": lambda request: request.GET == {"seen": "1"},
    "encoded": lambda request: request.GET.urlencode(),
    "meta": lambda request: request.META["QUERY_STRING"],
    "address": lambda request: (request.GET.get("seen"), request.build_absolute_uri()),
}
urlpatterns = [
    path("races/counted/", view_of(_counted), name="race"),
    *(path(f"races/query-{name}/", view_of(read), name=f"query_{name}") for name, read in QUERIES.items()),
    *(path(f"races/read-{name}/", view_of(read), name="race") for name, read in READS.items()),
    path("races/varies/", view_of(lambda _: "x", Vary="User-Agent"), name="race"),
    path("races/session/", view_of(_with_session), name="race"),
    path("races/key/", view_of(lambda request: (request.COOKIES.get("theme"), request.get_host())), name="race"),
    *(
        path(f"races/kept-{number}/", view_of(lambda _: "x", **{"Cache-Control": kept}), name="race")
        for number, kept in enumerate(KEPT)
    ),
    *site.urlpatterns,
]


@pytest.fixture(autouse=True)
def long_lived(monkeypatch) -> None:
    monkeypatch.setattr(guests, "LIVES_S", 3600.0)


@pytest.fixture
def addresses() -> list[str]:
    """One of each shared view, on a site where each has something to show."""
    now = timezone.now()
    season = open_demo_season(now=now - timedelta(days=45))
    alice = a_racer("alice")
    show = a_live_race(now, alice, slug="show-race", name="Show race")
    begun(event := a_show(now, alice, ["bob", "carol"], race=show), alice, now)
    drawn(now - timedelta(hours=2), 4, slug="robin", name="Robin")
    slot = event.slots.order_by("pk").first()
    known = {name: season.slug for name in ("season", "season_standings", "season_calendar")}
    known |= {"race_duels": "robin", "track_print": show.track.slug}
    runs = Evaluation.objects.values_list("public_id", flat=True)[:2]
    queries = {
        "live_poses": f"?slot={slot.pk}",
        "live_frames": f"?slot={slot.pk}&n=0",
        "live_ghost": f"?slot={slot.pk}",
    }
    found = []
    for name, pattern in _named(get_resolver().url_patterns):
        if name in guests.VIEWS:
            values = {"slug": known.get(name, "show-race"), "piece": "tower"}
            values |= {"public_id": runs[0], "other_id": runs[1]}
            kwargs = {key: values[key] for key in pattern.pattern.converters}
            found.append(reverse(name, kwargs=kwargs) + queries.get(name, ""))
    assert len(found) >= len(guests.VIEWS), "every shared view is tested"
    return found


def _named(patterns: list[URLPattern | URLResolver]) -> Iterator[tuple[str, URLPattern]]:
    for each in patterns:
        if isinstance(each, URLResolver):
            yield from _named(each.url_patterns)
        elif each.name:
            yield each.name, each


def _directives(answer: HttpResponse) -> set[str]:
    return {word.strip().lower() for word in answer.get("Cache-Control", "").split(",") if word.strip()}


def test_no_shared_page_weakens_the_cache_control_of_its_view(addresses):
    shared, answered, strict = Client(), 0, 0
    for address in addresses:
        with override_settings(MIDDLEWARE=WITHOUT):
            plain = Client().get(address)
        for _ in range(2):
            answer = shared.get(address)
            assert answer.status_code == plain.status_code, address
            assert _directives(answer) >= _directives(plain), address
            if plain.status_code == 200:
                assert _directives(answer) & {"private", "public"}, address
        answered += plain.status_code == 200
        strict += "no-store" in _directives(plain)
    assert answered >= 11 and strict >= 4, (answered, strict)


@pytest.mark.slow
def test_a_shared_page_answers_each_request_as_its_view_would(addresses):
    shared = Client()
    for address in addresses:
        shared.get(address)
        for others in OTHERS:
            with override_settings(MIDDLEWARE=WITHOUT):
                plain = Client().get(address, headers=others)
            answer = shared.get(address, headers=others)
            assert (answer.status_code, tag_of(answer.content)) == (plain.status_code, tag_of(plain.content)), address


@pytest.mark.urls("tests.config.test_shared_pages")
@pytest.mark.parametrize("read", READS)
def test_what_a_view_reads_outside_the_key_is_not_shared(read):
    client = Client()
    one = {"User-Agent": "One", "Accept": "text/html", "Accept-Language": "en", "Cookie": "other=1"}
    two = {"User-Agent": "Two", "Accept": "application/json", "Accept-Language": "en-GB", "Cookie": "other=2"}
    sent: list[dict[str, Any]] = [{"headers": one}, {"headers": {**two, "X-Extra": "1"}, "REMOTE_ADDR": "192.0.2.9"}]
    first, second = (client.get(f"/races/read-{read}/", **each).content for each in sent)
    assert first != second
    assert client.get(f"/races/read-{read}/", **sent[0]).content == first


@pytest.mark.urls("tests.config.test_shared_pages")
def test_what_a_view_reads_of_the_key_is_shared_by_key():
    client = Client()
    dark = client.get("/races/key/", headers={"Cookie": "theme=dark"})
    light = client.get("/races/key/", headers={"Cookie": "theme=light"})
    assert b"dark" in dark.content and b"light" in light.content
    assert dark.has_header("ETag"), "it was shared"
    assert b"localhost" in client.get("/races/key/", headers={"Host": "localhost", "Cookie": "theme=dark"}).content


@pytest.mark.urls("tests.config.test_shared_pages")
@pytest.mark.parametrize("name", ["varies", "session"])
def test_an_answer_that_varies_or_writes_a_session_is_not_shared(name):
    client = Client()
    answers = [client.get(f"/races/{name}/") for _ in range(2)]
    assert not any(answer.has_header("ETag") for answer in answers)


@pytest.mark.urls("tests.config.test_shared_pages")
@pytest.mark.parametrize("number", range(len(KEPT)))
def test_a_views_own_cache_control_is_passed_on(number):
    client = Client()
    for _ in range(2):
        answer = client.get(f"/races/kept-{number}/")
        assert answer["Cache-Control"] == KEPT[number]
        assert answer.has_header("ETag"), "it was shared in this process"


@pytest.mark.urls("tests.config.test_shared_pages")
def test_parameters_that_a_view_does_not_read_make_no_page_anew():
    client = Client()
    _made.clear()
    first = [client.get(f"/races/counted/?page=2&other={number}").content for number in range(20)]
    assert set(first) == {b"page 2, back to /races/counted/?page=2"}
    assert len(_made) <= 2, "the first reading tells which parameters count"
    assert b"page 3," in client.get("/races/counted/?other=1&page=3").content
    assert b"page 2," in client.get("/races/counted/?page=2").content
    assert _made[-1] == "3"


@pytest.mark.slow
def test_links_to_other_pages_of_a_list_make_no_page_anew(addresses, monkeypatch):
    """Each address that shows links with the query: the first reading may tell which parameters count."""
    made: list[str] = []
    make = guests.SharedPages._made

    def counted(self, request, *args):
        made.append(request.path)
        return make(self, request, *args)

    monkeypatch.setattr(guests.SharedPages, "_made", counted)
    client, seen = Client(), 0
    for address in addresses:
        for _ in range(3):
            made.clear()
            client.get(address)
        if not made:  # it is shared: neither missing nor with a form
            seen += 1
            join = "&" if "?" in address else "?"
            answers = {client.get(f"{address}{join}other={number}").content for number in range(4)}
            assert len(answers) == 1 and len(made) <= 1, address
    assert seen > len(addresses) / 2


@pytest.mark.urls("tests.config.test_shared_pages")
@pytest.mark.parametrize("read", QUERIES)
def test_parameters_that_a_view_reads_are_in_the_key(read, monkeypatch):
    monkeypatch.setattr(guests, "VIEWS", guests.VIEWS | {f"query_{read}"})
    client, plain = Client(), Client()
    for _ in range(3):
        for query in ("?seen=1", "?seen=2&seen=1", "?seen=3&x=1", "?seen="):
            with override_settings(MIDDLEWARE=WITHOUT):
                expected = plain.get(f"/races/query-{read}/{query}").content
            assert _without_x(client.get(f"/races/query-{read}/{query}").content) == _without_x(expected), query


def _without_x(content: bytes) -> bytes:
    return content.replace(b"&x=1", b"")

"""Cards, tags, embedded pages, oEmbed and site maps: they show what guests may see, and nothing else."""

from __future__ import annotations

import io
import json
from collections import defaultdict
from datetime import timedelta
from html.parser import HTMLParser
from urllib.robotparser import RobotFileParser
from xml.etree import ElementTree

import pytest
from django.conf import settings
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.urls import reverse
from django.utils import timezone
from PIL import Image

from config.sharing.sitemaps import SiteMap
from core.cards import drawing
from core.cards.drawing import DrawnCards, fingerprint
from core.cards.registry import card_kinds
from core.templatetags import sharing
from league.models import Season
from races.models import Race
from tests.clients import logged_in
from tests.factories import a_race, a_racer, drive, laps
from tests.live_shows import an_ended_show

pytestmark = pytest.mark.django_db


class Tags(HTMLParser):
    """The tags of a page as services that show links read them: its ``<meta>`` by property or name, its links."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.meta: dict[str, list[str]] = defaultdict(list)
        self.links: dict[str, dict[str, str]] = {}
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        if tag == "meta":
            self.meta[found.get("property") or found.get("name", "")].append(found.get("content", ""))
        elif tag == "link":
            self.links[f"{found.get('rel')} {found.get('type', '')}".strip()] = found

    def __getitem__(self, name: str) -> str:
        (value,) = self.meta[name]
        return value


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def led(now) -> Race:
    race = a_race(now, name="Night <race>", slug="night-race")
    drive(race, a_racer("zelda"), laps(9_123, 9_223, 9_323), now)
    return race


def path_of(address: str) -> str:
    assert address.startswith(settings.SITE_URL)
    return address.removeprefix(settings.SITE_URL)


def tags_of(page: str, client: Client | None = None) -> Tags:
    response = (client or Client()).get(page)
    assert response.status_code == 200
    return Tags(response.content.decode())


def run_of(race: Race) -> str:
    return race.entries.get().best.evaluation.public_id


def card_of(kind: str, key: str, language: str = "en", query: str = "", client: Client | None = None):
    return (client or Client()).get(reverse("card", args=[language, kind, key]) + query)


@pytest.mark.parametrize("kind", ["race", "run", "racer", "season", "track", "live"])
def test_a_page_has_the_tags_that_services_show_links_by(kind, led, now):
    key = {"race": led.slug, "run": run_of(led), "racer": "zelda", "track": led.track.slug}.get(kind)
    if kind == "season":
        last = now.date() + timedelta(days=90)
        key = Season.objects.create(name="S", slug="s", starts_on=now.date(), ends_on=last).slug
    if kind == "live":
        key = an_ended_show(now, a_racer("host")).race.slug
    page = card_kinds()[kind].address(key)
    tags = tags_of(page)
    assert tags["og:title"] == tags["twitter:title"] and tags["og:title"]
    assert tags["twitter:card"] == "summary_large_image"
    assert path_of(tags["og:url"]) == page == path_of(tags.links["canonical"]["href"])
    image = Client().get(path_of(tags["og:image"]))
    assert image.status_code == 200 and image["Content-Type"] == tags["og:image:type"]
    drawn = Image.open(io.BytesIO(image.content))
    assert drawn.size == (int(tags["og:image:width"]), int(tags["og:image:height"])) == (1200, 630)
    assert len(image.content) < 300_000


def test_a_title_is_the_text_that_the_page_shows(led):
    assert tags_of(led.get_absolute_url())["og:title"] == "Night <race>"


@pytest.mark.parametrize("page", ["/races/night-race/", "/racers/zelda/", "/tracks/oval/"])
def test_the_tags_cost_no_query(page, led, monkeypatch):
    def queries() -> int:
        with CaptureQueriesContext(connection) as found:
            tags_of(page)
        return len(found)

    with_tags = queries()
    monkeypatch.setattr(sharing, "render_to_string", lambda *args: "")
    assert queries() == with_tags


def test_racers_pages_have_no_tags(led):
    """What a racer may see is perhaps not for all."""
    page = tags_of(led.get_absolute_url(), logged_in(a_racer("amy")))
    assert "og:title" not in page.meta and "canonical" not in page.links


def test_a_card_has_the_words_of_its_language(led):
    english, korean = card_of("race", led.slug), card_of("race", led.slug, "ko")
    assert english.status_code == korean.status_code == 200 and english.content != korean.content
    assert card_of("race", led.slug, "xx").status_code == 404
    page = Client(headers={"accept-language": "ko"}).get(led.get_absolute_url()).content.decode()
    assert Tags(page)["og:locale"] == "ko_KR" and "/cards/ko/" in Tags(page)["og:image"]


def test_a_card_is_drawn_once_while_it_shows_the_same(led, now, monkeypatch):
    drawn = DrawnCards()
    monkeypatch.setattr(drawing, "drawn_cards", drawn)
    first = card_of("race", led.slug)
    monkeypatch.setattr(drawing, "draw_card", lambda card: b"another")
    again = card_of("race", led.slug)
    assert again.content == first.content and again["ETag"] == first["ETag"]
    assert again["Cache-Control"] == "public, max-age=3600"
    known = Client().get(reverse("card", args=["en", "race", led.slug]), headers={"if-none-match": first["ETag"]})
    assert known.status_code == 304
    drive(led, a_racer("yves"), laps(8_123, 8_223, 8_323), now)
    changed = card_of("race", led.slug)
    assert changed.content == b"another" and changed["ETag"] != first["ETag"]


def test_a_known_card_is_not_drawn(led, monkeypatch):
    etag = card_of("race", led.slug)["ETag"]
    monkeypatch.setattr(drawing, "drawn_cards", DrawnCards(a_minute=0))
    known = Client().get(reverse("card", args=["en", "race", led.slug]), headers={"if-none-match": etag})
    assert known.status_code == 304


def test_a_storm_for_different_cards_is_refused_with_the_time_to_come_again(led, monkeypatch):
    monkeypatch.setattr(drawing, "drawn_cards", DrawnCards(a_minute=2))
    answers = [
        card_of(*which) for which in (("race", led.slug), ("racer", "zelda"), ("track", "oval"), ("race", led.slug))
    ]
    assert [one.status_code for one in answers] == [200, 200, 503, 200]
    assert int(answers[2]["Retry-After"]) > 0


def test_few_drawn_cards_are_kept(led, monkeypatch):
    drawn = DrawnCards(kept=1)
    monkeypatch.setattr(drawing, "drawn_cards", drawn)
    for which in (("race", led.slug), ("racer", "zelda"), ("track", "oval")):
        card_of(*which)
    assert len(drawn._drawn) == 1


class TestSpoilers:
    @pytest.mark.parametrize("kind", ["race", "run", "racer"])
    def test_a_card_without_spoilers_has_no_result(self, kind, led):
        key = {"race": led.slug, "run": run_of(led), "racer": "zelda"}[kind]
        shown, hidden = (card_kinds()[kind].card(key, hides) for hides in (False, True))
        assert (shown.rows or shown.figures) and not (hidden.rows or hidden.figures)
        assert "0:09" not in repr(hidden) and (kind == "racer" or "0:09" in repr(shown))
        plain, asked = card_of(kind, key), card_of(kind, key, query="?spoilers=hide")
        assert asked["ETag"] == f'"{fingerprint(hidden)}"' != plain["ETag"]

    def test_what_a_reader_without_spoilers_shares_has_none(self, led):
        client = Client()
        client.post("/spoilers/", {"do": "hide"})
        page = client.get(led.get_absolute_url()).content.decode()
        assert Tags(page)["og:image"].endswith("?spoilers=hide") and Tags(page)["og:url"].endswith("?spoilers=hide")
        assert f'data-share-link="{settings.SITE_URL}{led.get_absolute_url()}?spoilers=hide"' in page
        assert card_of("race", led.slug, client=client)["ETag"] != card_of("race", led.slug)["ETag"]

    def test_an_embedded_board_without_spoilers_has_no_result(self, led):
        assert "zelda" in Client().get("/embed/race/night-race/").content.decode()
        assert "zelda" not in Client().get("/embed/race/night-race/?spoilers=hide").content.decode()
        assert "0:09" not in Client().get(f"/embed/run/{run_of(led)}/?spoilers=hide").content.decode()


class TestEmbedding:
    def test_an_embedded_page_alone_may_be_framed(self, led):
        for page in ("/embed/race/night-race/", f"/embed/run/{run_of(led)}/"):
            framed = Client().get(page)
            assert framed.status_code == 200 and "X-Frame-Options" not in framed.headers
            assert "frame-ancestors *" in framed["Content-Security-Policy"]
            assert "default-src 'none'" in framed["Content-Security-Policy"]
        for page in (
            led.get_absolute_url(),
            f"/evaluations/{run_of(led)}/",
            "/",
            "/accounts/login/",
            "/embed/race/none/",
        ):
            walled = Client().get(page)
            assert walled["X-Frame-Options"] == "DENY"
            assert "frame-ancestors 'none'" in walled["Content-Security-Policy"]

    def test_an_embedded_page_is_the_same_for_every_reader(self, led):
        guest = Client().get("/embed/race/night-race/").content
        assert logged_in(led.entries.get().racer).get("/embed/race/night-race/").content == guest
        assert b"csrf" not in guest and b"<form" not in guest

    def test_a_page_names_its_oembed_and_that_its_frame(self, led):
        for page in (led.get_absolute_url(), f"/evaluations/{run_of(led)}/"):
            tags = tags_of(page)
            found = json.loads(Client().get(path_of(tags.links["alternate application/json+oembed"]["href"])).content)
            assert (found["version"], found["type"], found["title"] != "") == ("1.0", "rich", True)
            frame = found["html"].split('src="')[1].split('"')[0]
            assert f'width="{found["width"]}" height="{found["height"]}"' in found["html"]
            assert Client().get(path_of(frame)).status_code == 200
            assert Client().get(path_of(found["thumbnail_url"])).status_code == 200

    def test_a_link_shared_without_results_is_embedded_without_them(self, led):
        Race.objects.filter(pk=led.pk).update(opens_at=timezone.now() - timedelta(days=2))
        tags = tags_of(f"{led.get_absolute_url()}?spoilers=hide")
        answer = Client().get(path_of(tags.links["alternate application/json+oembed"]["href"]))
        found = json.loads(answer.content)
        assert found["thumbnail_url"].endswith("?spoilers=hide")
        assert "zelda" not in Client().get(path_of(found["html"].split('src="')[1].split('"')[0])).content.decode()

    @pytest.mark.parametrize(
        ("query", "status"),
        [
            ("", 404),
            ("?url=https://elsewhere.example/races/night-race/", 404),
            (f"?url={settings.SITE_URL}/races/none/", 404),
            (f"?url={settings.SITE_URL}/tracks/oval/", 404),
            (f"?url={settings.SITE_URL}/about/", 404),
            ("?url=http://[/", 404),
            (f"?url={settings.SITE_URL}/races/night-race/&format=xml", 501),
            (f"?url={settings.SITE_URL}/races/night-race/&format=json", 200),
        ],
    )
    def test_oembed_knows_the_pages_that_may_be_framed(self, query, status, led):
        assert Client().get(f"/oembed/{query}").status_code == status

    @pytest.mark.parametrize(("asked", "given"), [("300", 300), ("1", 240), ("9999", 640), ("x", 640), ("-5", 640)])
    def test_a_frame_is_as_wide_as_there_is_room(self, asked, given, led):
        found = Client().get(f"/oembed/?url={settings.SITE_URL}/races/night-race/&maxwidth={asked}").json()
        assert found["width"] == given


class TestCrawlers:
    def test_the_map_leads_to_every_public_page(self, led):
        assert (
            Client().get("/robots.txt").content.decode().splitlines()[-1] == f"Sitemap: {settings.SITE_URL}/sitemap.xml"
        )
        index = Client().get("/sitemap.xml")
        assert index["Content-Type"] == "application/xml"
        pages = [page for part in addresses(index) for page in addresses(Client().get(path_of(part)))]
        assert {path_of(page) for page in pages} >= {
            *("/", "/races/night-race/", "/racers/zelda/", "/tracks/oval/", "/guides/racers/"),
            f"/evaluations/{run_of(led)}/",
        }
        assert {Client().get(path_of(page)).status_code for page in pages} == {200}

    def test_a_large_map_has_parts(self, led, monkeypatch):
        a_race(timezone.now(), slug="second")
        monkeypatch.setattr(SiteMap, "limit", 1)
        parts = [part for part in addresses(Client().get("/sitemap.xml")) if "sitemap-race." in part]
        assert [path_of(part) for part in parts] == ["/sitemap-race.xml", "/sitemap-race.xml?p=2"]
        assert addresses(Client().get(path_of(parts[1]))) == [f"{settings.SITE_URL}/races/second/"]

    @pytest.mark.parametrize("page", ["/sitemap-none.xml", "/sitemap-race.xml?p=9", "/sitemap-race.xml?p=x"])
    def test_a_map_that_is_not_there_is_404(self, page):
        assert Client().get(page).status_code == 404

    def test_crawlers_are_kept_from_accounts_and_not_from_cards(self):
        rules = RobotFileParser()
        rules.parse(Client().get("/robots.txt").content.decode().splitlines())
        closed = ("/accounts/login/", "/settings/", "/admin/", "/api/docs/")
        assert not any(rules.can_fetch("bot", page) for page in closed)
        cards = ("/", "/races/x/?t=12.3", "/cards/en/race/x.png?spoilers=hide", "/sitemap.xml", "/embed/run/x/")
        assert all(rules.can_fetch("bot", page) for page in cards)


def addresses(answer) -> list[str]:
    root = ElementTree.fromstring(answer.content)
    return [one.text for one in root.iter("{http://www.sitemaps.org/schemas/sitemap/0.9}loc")]

"""Sharing in a real Chromium: pages in a frame of another site, the share sheet of phones, and copied links."""

from __future__ import annotations

from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest
from django.conf import settings
from django.urls import reverse
from django.utils import timezone

from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from tests.pages.browsing import IN_A_BROWSER, SHOTS, chromium, shoot, visitor

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
SHEET = "navigator.share = (data) => { window.shared = data; return Promise.resolve(); }"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def run(alice, wakes):
    now = timezone.now()
    return a_driven_run(a_race(now, slug="night", name="Night race"), alice, now, lap_ms=9_000)


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[str]:
    """Another site, whose pages frame the address after "?"."""

    class Elsewhere(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(f'<iframe src="{self.path[2:]}" width="640" height="640"></iframe>'.encode())

        def log_message(self, *args: object) -> None:
            """No line on the terminal."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_another_site_frames_a_run_that_plays_and_a_board(browser, live_server, elsewhere, run, alice):
    with visitor(browser, live_server.url) as context:
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"{elsewhere}/?{live_server.url}/embed/run/{run.public_id}/")
        frame = page.frame_locator("iframe")
        frame.locator("[data-toggle]").click()
        playwright.expect(frame.locator("[data-out]")).not_to_contain_text("0:00.000")
        if SHOTS:
            page.screenshot(path=f"{SHOTS}/embedded-run.png")
        page.goto(f"{elsewhere}/?{live_server.url}/embed/race/night/")
        playwright.expect(frame.get_by_role("row", name=alice.alias)).to_be_visible()
        if SHOTS:
            page.screenshot(path=f"{SHOTS}/embedded-board.png")
        assert not errors


def test_no_other_page_is_framed(browser, live_server, elsewhere, run):
    with visitor(browser, live_server.url) as context:
        page, said = context.new_page(), []
        page.on("console", lambda message: said.append(message.text))
        for address in ("/races/night/", run.get_absolute_url(), "/accounts/login/"):
            said.clear()
            page.goto(f"{elsewhere}/?{live_server.url}{address}")
            playwright.expect(page.frame_locator("iframe").locator("#main")).to_have_count(0)
            assert any("frame-ancestors" in text or "X-Frame-Options" in text for text in said), (address, said)


def test_a_phone_opens_its_share_sheet(browser, live_server, run, alice):
    addresses = {"race": "/races/night/", "run": run.get_absolute_url(), "racer": alice.get_absolute_url()}
    phone = {"has_touch": True, "is_mobile": True, "viewport": {"width": 360, "height": 740}}
    with visitor(browser, live_server.url, **phone) as context:
        context.add_init_script(SHEET)
        page = context.new_page()
        for kind, address in addresses.items():
            page.goto(address)
            page.get_by_role("button", name="Share", exact=True).click()
            assert page.evaluate("shared")["url"] == f"{settings.SITE_URL}{address}"
            assert page.evaluate("document.documentElement.scrollWidth") <= 360
            if SHOTS:
                shoot(page, f"share-{kind}")


def test_elsewhere_the_link_is_copied(browser, live_server, run):
    with visitor(browser, live_server.url) as context:
        context.grant_permissions(["clipboard-read", "clipboard-write"], origin=live_server.url)
        page = context.new_page()
        page.goto(run.get_absolute_url())
        page.get_by_role("button", name="Share", exact=True).click()
        playwright.expect(page.get_by_role("button", name="Link copied")).to_be_visible()
        assert page.evaluate("navigator.clipboard.readText()") == f"{settings.SITE_URL}{run.get_absolute_url()}"
        playwright.expect(page.get_by_role("button", name="Share", exact=True)).to_be_focused()


def test_a_link_to_a_moment_keeps_what_the_page_is_made_of(browser, live_server, run):
    """Its time and camera are for the script alone, and change no tag."""
    address = f"{settings.SITE_URL}{reverse('replay', args=[run.public_id])}"
    with visitor(browser, live_server.url) as context:
        page = context.new_page()
        page.goto(f"{reverse('replay', args=[run.public_id])}?lap=2&t=2.5&camera=chase")
        assert page.locator('meta[property="og:url"]').get_attribute("content") == f"{address}?lap=2"
        assert page.locator('link[rel="canonical"]').get_attribute("href") == address

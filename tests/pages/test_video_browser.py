"""A video of a real run, from the button to a player that plays it: site, broker, worker and encoder."""

from __future__ import annotations

import re

import pytest

from tests.pages.browsing import IN_A_BROWSER
from tests.pages.test_browser import DRIVE_MS, browser, page, playwright, race_on_the_oval, sign_up  # noqa: F401
from tests.shared import CHECKOUT

pytestmark = IN_A_BROWSER
DRAW_MS = 120_000
HOUSE_CARS = CHECKOUT / "training" / "house_cars"
CARD_S = 2.5  # the figures at the end


def a_run_on_the_oval(page: playwright.Page) -> None:  # noqa: F811
    """The house's fastest car in a race of one's own, driven to its end; the page of the run is open."""
    page.goto("/models/upload/")
    files = [("flyer.onnx", "flyer.onnx"), ("model_metadata.json", "flyer.json")]
    page.locator("input[type=file]").set_input_files(
        [
            {"name": name, "mimeType": "application/octet-stream", "buffer": (HOUSE_CARS / source).read_bytes()}
            for name, source in files
        ]
    )
    page.get_by_role("main").get_by_role("button", name="Upload").click()
    playwright.expect(page.get_by_role("heading", name="flyer", exact=True)).to_be_visible(timeout=DRIVE_MS)
    race_on_the_oval(page, "Video night")


@pytest.mark.soak
def test_a_racer_makes_a_video_of_a_best_lap_and_a_guest_watches_it(
    page: playwright.Page,  # noqa: F811
    browser: playwright.Browser,  # noqa: F811
    site: str,
) -> None:
    sign_up(page, "viewer")
    a_run_on_the_oval(page)
    card = page.locator("#video")
    offered = card.get_by_label("Clip").locator("option:checked").inner_text()
    lap_s = int(re.search(r"0:(\d\d)\.(\d{3})", offered)[1]) + int(re.search(r"0:(\d\d)\.(\d{3})", offered)[2]) / 1000
    card.get_by_role("button", name="Make a video").click()
    playwright.expect(card.get_by_role("progressbar")).to_be_visible()

    # the page follows it without a reload
    player = card.locator("video")
    playwright.expect(player).to_be_visible(timeout=DRAW_MS)
    page.wait_for_function("() => (({ readyState, error }) => readyState || error)(document.querySelector('video'))")
    assert player.evaluate("video => video.error && video.error.message") is None
    assert player.evaluate("video => video.duration") == pytest.approx(lap_s + CARD_S, abs=0.1)
    assert player.evaluate("video => video.videoWidth") == 1280

    # it plays, and can be jumped about in: the site sends the parts that the player asks for
    player.evaluate("video => { video.muted = true; return video.play(); }")
    player.evaluate("(video, at) => { video.currentTime = at; }", lap_s - 1)
    page.wait_for_function("at => document.querySelector('video').currentTime >= at", arg=lap_s - 0.5)
    with page.expect_download() as download:
        card.get_by_role("link", name="Download (MP4").click()
    assert download.value.suggested_filename.endswith(".mp4")

    guest = browser.new_context(base_url=site, locale="en-GB").new_page()
    guest.goto(page.url)
    playwright.expect(guest.locator("#video video")).to_be_visible()
    playwright.expect(guest.locator("#video form")).to_have_count(0)
    guest.context.close()

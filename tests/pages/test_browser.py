"""The whole way in a real browser, on the whole stack: site, worker, broker, sandbox, simulator."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.hostile.parts import small_car, training_folder
from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.shared import CONSOLE_CAR, needs_shared
from tests.soak import only

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

DRIVE_MS = 60_000
PASSWORD = "a long enough passphrase"

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def browser() -> Iterator[playwright.Browser]:
    with chromium() as opened:
        yield opened


@pytest.fixture
def page(browser: playwright.Browser, site: str) -> Iterator[playwright.Page]:
    """A page that fails the test when the browser complains: a script's error, or something the policy blocked."""
    context = browser.new_context(base_url=site, locale="en-GB", timezone_id="Europe/Berlin")
    opened = context.new_page()
    complaints: list[str] = []
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)
    yield opened
    context.close()
    assert not [text for text in complaints if "status of 4" not in text]


def sign_up(page: playwright.Page, alias: str) -> None:
    page.goto("/")
    page.get_by_role("banner").get_by_role("link", name="Sign up").click()
    page.get_by_label("Alias").fill(alias)
    page.get_by_label("Email").fill(f"{alias}@example.org")
    page.get_by_label("Password", exact=True).fill(PASSWORD)
    page.get_by_label("Password (again)").fill(PASSWORD)
    page.get_by_role("main").get_by_role("button", name="Sign up").click()
    playwright.expect(page.get_by_text(f"Welcome, {alias}.")).to_be_visible()


def upload_console_car(page: playwright.Page) -> None:
    page.goto("/models/upload/")
    page.locator("input[type=file]").set_input_files(CONSOLE_CAR)
    playwright.expect(page.locator("[data-chosen]")).to_contain_text("deepracer-console-15.tar.gz")
    page.get_by_role("main").get_by_role("button", name="Upload").click()
    playwright.expect(page.get_by_role("heading", name="deepracer-console-15", exact=True)).to_be_visible(
        timeout=DRIVE_MS
    )


def race_on_the_oval(page: playwright.Page, name: str) -> None:
    """Hold a race, send the one car in the garage to it and watch it to its end, without reloading anything."""
    page.goto("/races/new/?track=oval")
    page.get_by_label("Name").fill(name)
    page.get_by_role("button", name="Create the race").click()
    page.locator("#send").get_by_role("button", name="Submit").click()
    page.locator("#live-card a").first.click()
    playwright.expect(page.get_by_role("heading", name="Laps", exact=True)).to_be_visible(timeout=DRIVE_MS)


@needs_shared
def test_a_newcomer_uploads_a_console_model_and_finds_it_ranked(page: playwright.Page) -> None:
    sign_up(page, "newcomer")
    upload_console_car(page)

    # the month's race, from the first page
    page.goto("/")
    page.locator(".race-card", has_text="open division").get_by_role("heading").get_by_role("link").click()
    page.get_by_role("link", name="Submit a car").click()
    page.get_by_label("Model").select_option(label="deepracer-console-15")
    page.locator("#send").get_by_role("button", name="Submit").click()

    # the box follows the car without reloading, then the board shows it
    playwright.expect(page.locator("#live-card .pill")).to_have_text("finished", timeout=DRIVE_MS)
    row = page.locator("table.board tr.me")
    playwright.expect(row).to_contain_text("newcomer", timeout=10_000)
    playwright.expect(row.locator(".place")).to_have_text(re.compile(r"^\d+$"))
    playwright.expect(row).to_contain_text(re.compile(r"\d:\d\d\.\d{3}"))

    # the result: laps, the line, the files
    row.get_by_role("link", name="Watch the run").click()
    playwright.expect(page.locator("table.laps tbody tr")).to_have_count(3)
    assert page.locator(".track-line").count() > 0
    page.get_by_text("Files and proof").click()
    with page.expect_download() as download:
        page.get_by_role("link", name="Trace of every step").click()
    assert Path(download.value.path()).read_text().startswith("episode,steps,X,Y,")

    # a community race of one's own, on the same car
    race_on_the_oval(page, "Lunch break")
    page.get_by_role("link", name="To the board").click()
    playwright.expect(page.locator("table.board tr.me .place")).to_have_text("1")


def test_boxes_placed_by_an_organiser_appear_on_the_map(page: playwright.Page) -> None:
    sign_up(page, "boxer")
    page.goto("/races/new/?track=oval")
    page.get_by_label("Name").fill("Slalom")
    boxes = page.locator("fieldset", has=page.get_by_role("group", name="Boxes", exact=True)).last
    playwright.expect(boxes).to_be_hidden()
    page.get_by_label("object avoidance").check()
    page.get_by_label("in the positions I choose").check()
    playwright.expect(page.get_by_label("How many boxes")).to_be_hidden()

    # a row for each box, and the map follows
    page.get_by_label("Box 1: percentage of the lap").fill("25")
    page.get_by_label("Box 1: lane").select_option(label="inner lane")
    page.get_by_role("button", name="Add a box").click()
    playwright.expect(page.get_by_label("Box 2: percentage of the lap")).to_be_focused()
    page.keyboard.type("26")
    page.get_by_label("Box 2: lane").select_option(label="outer lane")
    playwright.expect(page.locator("#layout")).to_contain_text("Boxes 1 and 2 block the track")
    page.get_by_label("Box 2: percentage of the lap").fill("60")
    page.get_by_label("Box 2: percentage of the lap").blur()
    playwright.expect(page.locator("#layout .track-box")).to_have_count(2)
    playwright.expect(page.locator("#layout")).to_contain_text("Box 2: 60 % of the lap, outer lane")

    page.get_by_role("button", name="Create the race").click()
    playwright.expect(page.get_by_role("heading", name="Slalom")).to_be_visible()
    playwright.expect(page.locator(".hero-map .track-box")).to_have_count(2)
    playwright.expect(page.locator(".hero .pills").first).to_contain_text("object avoidance")
    page.get_by_role("link", name="Edit").click()
    playwright.expect(page.get_by_label("Box 2: percentage of the lap")).to_have_value("60")
    playwright.expect(page.get_by_label("Box 3: percentage of the lap")).to_be_hidden()


def test_a_refused_file_is_explained_and_the_page_still_works(page: playwright.Page, tmp_path: Path) -> None:
    sign_up(page, "clumsy")
    empty = tmp_path / "car.tar.gz"
    empty.write_bytes(b"")
    page.goto("/models/upload/")
    page.locator("input[type=file]").set_input_files(empty)
    page.get_by_role("main").get_by_role("button", name="Upload").click()
    fault = page.locator(".fault")
    playwright.expect(fault).to_contain_text("The file is empty")
    playwright.expect(fault).to_be_focused()
    assert fault.locator("[data-code]").get_attribute("data-code") == "empty"
    playwright.expect(page.get_by_role("main").get_by_role("button", name="Upload")).to_be_enabled()


def test_a_file_that_is_too_large_is_reported_before_it_is_sent(page: playwright.Page, tmp_path: Path) -> None:
    sign_up(page, "heavy")
    huge = tmp_path / "model.tar.gz"
    with huge.open("wb") as file:
        file.truncate(513 * 1024 * 1024)
    page.goto("/models/upload/")
    page.locator("input[type=file]").set_input_files(huge)
    playwright.expect(page.locator("[data-chosen]")).to_contain_text("Larger than the limit of 512 MB")
    page.get_by_role("main").get_by_role("button", name="Upload").click()
    assert page.evaluate("document.querySelector('input[type=file]').validity.customError")
    assert page.url.endswith("/models/upload/")


def test_a_training_folder_is_uploaded_and_a_checkpoint_chosen(page: playwright.Page, tmp_path: Path) -> None:
    [(name, folder)] = training_folder({4: small_car(), 9: small_car()}, lead="rl-deepracer/")
    (tmp_path / name).write_bytes(folder)
    sign_up(page, "trainee")
    page.goto("/models/upload/")
    page.locator("input[type=file]").set_input_files(tmp_path / name)
    page.get_by_label("Checkpoint").fill("5")
    page.get_by_role("main").get_by_role("button", name="Upload").click()
    playwright.expect(page.get_by_text("Available: 4, 9.")).to_be_visible()
    page.locator("input[type=file]").set_input_files(tmp_path / name)
    page.get_by_label("Checkpoint").fill("4")
    page.get_by_role("main").get_by_role("button", name="Upload").click()
    playwright.expect(page.get_by_text("model_4.pb, as chosen")).to_be_visible()
    playwright.expect(page.get_by_text("files ignored")).to_be_visible()


def test_a_track_is_found_by_its_official_name_and_by_its_figures(page: playwright.Page) -> None:
    page.goto("/tracks/")
    names = page.locator(".tile h2")
    # sorted by how often they have been raced
    season = {"Baja Turnpike", "Baja Highway", "Kuei Raceway", "Kuei Super Raceway", "Cosmic Loop", "Cosmic Circuit"}
    assert set(names.all_inner_texts()[:1]) <= season | {"Paddock Oval"}
    page.get_by_label("Name of a track").fill("hamption")
    page.get_by_label("Sorted by").select_option(label="Length")
    page.get_by_label("Name of a track").press("Enter")
    playwright.expect(names).to_have_text(["Kuei Raceway", "Kuei Super Raceway"])
    playwright.expect(page.get_by_label("Sorted by")).to_have_value("length")
    page.get_by_role("link", name="Show all").click()
    page.get_by_label("Sorted by").select_option(label="Difficulty")
    page.get_by_role("main").get_by_role("button", name="Show").click()
    playwright.expect(names.first).to_have_text("Straight Track")
    playwright.expect(names.nth(1)).to_have_text(re.compile("Ace Speedway|Rogue Circuit"))
    names.nth(1).get_by_role("link").click()
    playwright.expect(page.get_by_role("definition").filter(has_text="easy · 9")).to_be_visible()


def test_the_skip_link_and_the_menu_work_from_the_keyboard(page: playwright.Page) -> None:
    sign_up(page, "tabber")
    page.goto("/races/")
    page.keyboard.press("Tab")
    playwright.expect(page.get_by_text("Skip to the content")).to_be_focused()
    page.keyboard.press("Enter")
    playwright.expect(page.locator("#main")).to_be_focused()
    menu = page.locator("details.menu summary")
    menu.focus()
    page.keyboard.press("Enter")
    playwright.expect(page.get_by_role("link", name="API tokens")).to_be_visible()
    page.keyboard.press("Escape")
    playwright.expect(page.get_by_role("link", name="API tokens")).to_be_hidden()
    playwright.expect(menu).to_be_focused()


def test_the_theme_is_kept_without_a_flash_of_the_other(page: playwright.Page) -> None:
    page.emulate_media(color_scheme="light")
    page.goto("/about/")
    page.get_by_role("button", name="Dark or light").click()
    assert page.locator("html").get_attribute("data-theme") == "dark"
    body = page.request.get("/about/").text()
    assert 'data-theme="dark"' in body, "the server paints it, so nothing flashes"
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(12, 15, 20)"


def test_times_are_shown_in_the_visitors_time_zone(page: playwright.Page) -> None:
    page.goto("/races/")
    page.locator(".race-card :is(h2, h3) a").first.click()
    moment = page.locator(".race-side dl time").first
    playwright.expect(moment).to_have_attribute("title", re.compile(r"CES?T · Europe/Berlin$"))
    assert page.locator("time[data-local]").count() == 0


@pytest.mark.parametrize("twice", only([False], [False, True]))
def test_no_page_is_wider_than_a_small_phone(twice: bool, page: playwright.Page) -> None:
    alias = ("M" if twice else "W") * 64
    sign_up(page, alias)
    page.set_viewport_size({"width": 360, "height": 740})
    wide = {}
    for path in (
        "/",
        "/about/",
        "/races/",
        "/races/new/",
        "/races/?show=closed",
        "/tracks/",
        "/tracks/oval/",
        "/tracks/import/",
        "/models/",
        "/models/upload/",
        "/settings/",
        "/settings/tokens/",
        "/accounts/email/",
        "/accounts/password/change/",
        f"/racers/{alias}/",
        "/nothing/",
    ):
        # in English every page is looked at in tests/pages/test_every_page_browser.py
        for language in ("en", "ko") if twice or alias in path else ("ko",):
            page.context.add_cookies([{"name": "django_language", "value": language, "url": page.url}])
            page.goto(path)
            over = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            if over > 0:
                wide[path, language] = over
    assert not wide


def test_sign_up_language_and_theme_work_without_scripts(browser: playwright.Browser, site: str) -> None:
    context = browser.new_context(base_url=site, java_script_enabled=False, locale="en-GB")
    page = context.new_page()
    sign_up(page, "scriptless")
    page.get_by_role("button", name="한국어").click()
    playwright.expect(page.get_by_role("link", name="차고").first).to_be_visible()
    page.get_by_role("button", name="EN").click()
    page.get_by_role("button", name="Dark or light").click()
    assert page.locator("html").get_attribute("data-theme") == "dark"
    page.get_by_text("scriptless", exact=True).first.click()
    page.get_by_role("button", name="Log out").click()
    playwright.expect(page.get_by_role("banner").get_by_role("link", name="Log in")).to_be_visible()
    context.close()

"""New content is morphed into a page: what its reader is doing goes on, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.shared import CHECKOUT

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytestmark = IN_A_BROWSER
SCRIPTS = ("vendor/idiomorph.min.js", "live-page.js")
WITHOUT_MOVE_BEFORE = "delete Element.prototype.moveBefore"  # browsers that lose the focus of an element that moves


def board(*rows: str, note: str = "", speed: int = 1, track: str = "oval") -> str:
    listed = "".join(f'<li data-key="{row}"><a href="#{row}">{row}</a> <b class="time">{note}</b></li>' for row in rows)
    options = "".join(f"<option{' selected' * (name == track)}>{name}</option>" for name in ("oval", "bowtie", "eight"))
    return f"""<body><section id="part" data-follow="race:1"><p>{note}</p><ol>{listed}</ol>
<details><summary>More</summary><p>{note}</p></details><form><input name="text" value="{note}">
<input name="speed" value="{speed}"><select name="track">{options}</select></form>
<div id="log" style="height: 20px; overflow: auto"><p style="height: 200px">{note}</p></div></section></body>"""


@pytest.fixture(params=["", WITHOUT_MOVE_BEFORE], ids=["moveBefore", "insertBefore"])
def page(request) -> Iterator[playwright.Page]:
    with chromium() as browser:
        opened = browser.new_page()
        errors: list[str] = []
        opened.on("pageerror", lambda error: errors.append(str(error)))
        opened.add_init_script(request.param)
        change(opened, board("ann", "bob", "cem", note="old"))
        opened.goto("http://board.test/")
        for script in SCRIPTS:
            opened.add_script_tag(path=CHECKOUT / "static" / script)
        yield opened
    assert not errors


def change(page: playwright.Page, body: str) -> None:
    page.route("http://board.test/", lambda route: route.fulfill(body=body, content_type="text/html"))


def renew(page: playwright.Page, body: str) -> None:
    """Let the server answer with this page, and the page fetch it."""
    change(page, body)
    with page.expect_response("http://board.test/"):
        page.evaluate("livePage.moved(['race:1'])")


def test_the_focus_and_the_elements_of_rows_move_with_them(page: playwright.Page) -> None:
    page.evaluate("document.querySelectorAll('li').forEach((row) => { row.state = row.dataset.key; })")
    page.get_by_role("link", name="cem").focus()
    renew(page, board("cem", "dan", "ann", "bob", note="new"))
    playwright.expect(page.locator("li")).to_have_text(["cem new", "dan new", "ann new", "bob new"])
    playwright.expect(page.get_by_role("link", name="cem")).to_be_focused()
    assert page.evaluate("[...document.querySelectorAll('li')].map((row) => row.state ?? '')") == [
        "cem",
        "",
        "ann",
        "bob",
    ]
    renew(page, board("bob", "ann", note="new"))
    playwright.expect(page.locator("li")).to_have_text(["bob new", "ann new"])
    assert page.evaluate("document.activeElement === document.body"), "the row with the focus is gone"


def test_fields_that_the_reader_changed_and_open_details_stay(page: playwright.Page) -> None:
    page.locator("summary").click()
    page.locator("[name=track]").select_option("eight")
    text = page.locator("[name=text]")
    text.fill("my words")
    text.evaluate("(field) => field.setSelectionRange(2, 5)")
    page.locator("#log").evaluate("(log) => { log.scrollTop = 70; }")
    renew(page, board("bob", "ann", "cem", note="new", speed=3, track="bowtie"))
    playwright.expect(page.locator("details p")).to_have_text("new")
    playwright.expect(page.locator("details p")).to_be_visible()
    assert text.input_value() == "my words"
    assert text.evaluate("(field) => [field.selectionStart, field.selectionEnd]") == [2, 5]
    playwright.expect(text).to_be_focused()
    assert page.locator("[name=track]").input_value() == "eight"
    assert page.locator("[name=speed]").input_value() == "3", "the server changes a field that the reader did not"
    assert page.locator("#log").evaluate("(log) => log.scrollTop") == 70


def test_a_field_without_the_readers_input_follows_the_server(page: playwright.Page) -> None:
    renew(page, board("ann", note="new", track="bowtie"))
    playwright.expect(page.locator("[name=text]")).to_have_value("new")
    playwright.expect(page.locator("[name=track]")).to_have_value("bowtie")


def test_attributes_that_scripts_added_stay(page: playwright.Page) -> None:
    page.evaluate("document.querySelector('ol').tabIndex = 0")
    renew(page, board("ann", note="new"))
    playwright.expect(page.locator("li")).to_have_text(["ann new"])
    assert page.locator("ol").get_attribute("tabindex") == "0"

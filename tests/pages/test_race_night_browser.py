"""A race night on a whole site: real cars, real workers, its clock and its streams; an organiser, three racers, a
spectator on a phone, the big screen and an overlay, each in a browser of its own, from the lobby to the podium."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic

import pytest

from tests.config.test_run import environment
from tests.live_site import QUIET, LiveSite
from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.shared import CHECKOUT

pytestmark = [*IN_A_BROWSER, pytest.mark.soak]
LATE_MS = 60_000
SHOTS = os.environ.get("PADDOCK_TEST_SHOTS", "")  # a folder, for who wants to look
SIZES = {
    "big": {"viewport": {"width": 1920, "height": 1080}},
    "huge": {"viewport": {"width": 3840, "height": 2160}},
    "tower": {"viewport": {"width": 480, "height": 800}},
    "phone": {"viewport": {"width": 360, "height": 740}},
    "wide": {"viewport": {"width": 1280, "height": 900}},
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, new_data: Callable[..., Path]) -> Iterator[LiveSite]:
    data = new_data(tmp_path_factory.mktemp("night") / "data", house_cars=0)
    with LiveSite(data) as site:
        yield site.ready()
        site.stop(signal.SIGINT)


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


class Audience:
    """Everybody's windows, and error in them."""

    def __init__(self, site: LiveSite, browser, sessions: dict[str, str]) -> None:
        self.site, self.browser, self.sessions, self.wrong = site, browser, sessions, []
        self.pages: dict[str, object] = {}

    def opens(self, name: str, path: str, who: str | None = None, size: str = "wide", **options):
        session = None if who is None else self.sessions[who]
        page = self.site.visit(self.browser, session, **SIZES[size], **options)
        page.on("pageerror", lambda error: self.wrong.append(f"{name}: {error}"))
        page.on("console", lambda line: self.wrong.append(f"{name}: {line.text}") if is_fault(line) else None)
        page.goto(path)
        self.pages[name] = page
        return page

    def shots(self, moment: str, *names: str) -> None:
        """Windows as they are, in both themes."""
        if SHOTS:
            for name in names:
                page = self.pages[name]
                for theme in ("light", "dark"):
                    page.emulate_media(color_scheme=theme)
                    path = Path(SHOTS, f"{moment}-{name}-{theme}.png")
                    page.screenshot(path=path, omit_background=name.startswith("overlay"))


def is_fault(line) -> bool:
    """Not that an answer was late: a page asks again, and tonight's machine has much to do."""
    return line.type == "error" and not line.text.startswith("htmx:")


def until(page, holds: Callable[[], object], limit_s: float = 90.0) -> None:
    end = monotonic() + limit_s
    while not holds():
        assert monotonic() < end, "it never came true"
        page.wait_for_timeout(200)


def done(site: LiveSite) -> int:
    return site.rows("select count(*) from races_liveslot where state = 'done'")[0][0]


def launch(page, who: str) -> None:
    """As soon as it is computed, by the organiser's button."""
    from playwright.sync_api import expect

    row = page.locator(".console-slot", has_text=who).filter(has=page.locator(".pill.good")).first
    expect(row).to_be_visible(timeout=LATE_MS)
    page.get_by_role("button", name=f"Launch {who}").click()


def test_a_time_trial_of_six_from_the_lobby_to_the_podium(site, browser):
    from playwright.sync_api import expect

    made = site.make("night", cars=6, attempt_s=40, speed_control=True, gap_s=2)
    all_of = Audience(site, browser, made["sessions"])
    base = f"/races/{made['race']}"
    racing = {name: all_of.opens(name, f"{base}/event/", who=name) for name in ("bob", "carl", "dora")}
    for name, page in racing.items():
        page.get_by_role("button", name="Drive with it").click()
        page.get_by_role("button", name="I am here").click()
        expect(page.locator("#live-side")).to_contain_text("You are here.")
        expect(page.locator("#live-side")).to_contain_text(f"of {name}")
    phone = all_of.opens("phone", f"{base}/live/phone/", size="phone")
    big = all_of.opens("big", f"{base}/live/screen/", size="big")
    tower = all_of.opens("overlay", f"{base}/live/overlay/tower/", size="tower")
    console = all_of.opens("console", f"{base}/event/console/", who="alice")
    expect(big.locator("[data-countdown]")).to_contain_text(":", timeout=LATE_MS)
    all_of.shots("1-lobby", "bob", "phone")

    driver = all_of.opens("speed", f"{base}/event/speed/", who="bob", size="phone")
    console.get_by_role("button", name="Begin").click()
    launch(console, "bob")
    # the racer makes their car slower while everybody counts down
    driver.get_by_role("button", name="×0.5").click()
    driver.get_by_role("button", name="Command now").click()
    expect(driver.locator("#speed-state")).to_contain_text("0.5 × the model's speed", timeout=LATE_MS)
    all_of.shots("2-coming", "speed")
    for page in (phone, big):
        expect(page.locator("[data-who]")).to_have_text("bob", timeout=LATE_MS)
        expect(page.locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
    expect(racing["carl"].locator('[data-car="0"]')).to_be_visible(timeout=LATE_MS)
    expect(racing["carl"].locator("#live-side")).to_contain_text("Speed command", timeout=LATE_MS)
    all_of.shots("3-commanded", "speed", "carl", "big")
    until(console, lambda: done(site) == 1)
    (log,) = site.rows("select speed_log from races_liveslot where state = 'done'")
    assert '"value": 0.5' in log[0], log

    launch(console, "carl")
    expect(big.locator("[data-who]")).to_have_text("carl", timeout=LATE_MS)
    expect(big.locator("[data-ghost]")).to_be_visible(timeout=LATE_MS)
    all_of.opens("commentary", f"{base}/live/commentary/")
    for piece in ("clock", "lower-third", "next"):
        all_of.opens(f"overlay-{piece}", f"{base}/live/overlay/{piece}/")
    for page in (racing["dora"], phone):
        page.locator("[data-frames] summary").click()
        expect(page.locator(".seen-cars figcaption")).to_contain_text("m/s", timeout=LATE_MS)
    if SHOTS:
        all_of.opens("huge", f"{base}/live/screen/", size="huge")
    big.wait_for_timeout(5_000)
    all_of.shots("4-carl", "big", "overlay", "phone", "overlay-clock", "overlay-lower-third", "overlay-next")
    all_of.shots("4-carl", "huge" if SHOTS else "big", "dora", "commentary")
    console.get_by_role("button", name="Run automatically").click()
    until(console, lambda: done(site) == 6, 360)
    console.reload()
    console.get_by_role("button", name="End the event").click()
    for page in (big, phone):
        expect(page.locator("[data-podium] li")).to_have_count(3, timeout=LATE_MS)
    all_of.shots("5-podium", "huge" if SHOTS else "big", "big", "phone", "console", "commentary", "dora")

    # the show is over: the same order everywhere, and the board's is it
    order = big.locator("[data-podium] li .name").all_text_contents()
    assert phone.locator("[data-podium] li .name").all_text_contents() == order
    expect(tower.locator("[data-tower] .who").first).to_have_text(order[0], timeout=LATE_MS)
    expect(racing["dora"].locator(".show-podium li")).to_have_text(order, timeout=LATE_MS)
    racing["dora"].goto(f"{base}/")
    expect(racing["dora"].locator("table.board tbody tr").first).to_contain_text(order[0])
    assert not all_of.wrong
    assert "Traceback" not in site.said, site.said[-5000:]

    # every result is driven again to the bit, the one with commands, too
    for public_id, speeds in site.rows(
        "select e.public_id, s.speed_log is not null from races_liveslot s join evaluation_evaluation e"
        " on e.id = s.evaluation_id where s.state = 'done' order by 2 desc limit 2"
    ):
        verified = verify(site, public_id)
        assert verified.returncode == 0, (speeds, verified.stdout, verified.stderr)


def verify(site: LiveSite, run: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "manage.py", "verify", run]
    return subprocess.run(
        command, cwd=CHECKOUT, env=environment(site.data) | QUIET, capture_output=True, text=True, timeout=300
    )


def test_a_bracket_of_eight_by_itself(site, browser):
    from playwright.sync_api import expect

    made = site.make("field", cars=8)
    all_of = Audience(site, browser, made["sessions"])
    waits = "select count(*) from evaluation_evaluation where state in ('queued', 'running')"
    page = all_of.opens("board", "/races/knock-out/")
    until(page, lambda: site.rows(waits)[0][0] == 0, 240)
    site.make("bracket")
    big = all_of.opens("big", "/races/knock-out/live/screen/", size="big")
    phone = all_of.opens("phone", "/races/knock-out/live/phone/", size="phone")
    tree = all_of.opens("overlay-bracket", "/races/knock-out/live/overlay/bracket/", size="big")
    console = all_of.opens("console", "/races/knock-out/event/console/", who="alice")
    watching = all_of.opens("watching", "/races/knock-out/event/")
    expect(big.locator('[data-car="0"]')).to_be_visible(timeout=90_000)
    expect(watching.locator("[data-rival]")).to_be_visible(timeout=LATE_MS)
    watching.wait_for_timeout(3_000)
    all_of.shots("6-heat", "big", "watching", "phone")
    heats = "select count(*) from races_duel where state = 'decided'"
    expect(tree.locator(".bracket-car.won").first).to_be_visible(timeout=180_000)
    all_of.shots("7-bracket", "overlay-bracket", "big")
    until(console, lambda: site.rows(heats)[0][0] >= 8, 600)
    all_of.opens("commentary", "/races/knock-out/live/commentary/")
    all_of.shots("8-semi-finals", "commentary", "console", "watching")
    until(console, lambda: site.rows(heats)[0][0] == 14, 600)
    until(console, lambda: site.rows("select count(*) from races_draw where over_at is not null")[0][0], 60)
    console.reload()
    console.get_by_role("button", name="End the event").click()
    for page in (big, phone):
        expect(page.locator("[data-podium] li")).to_have_count(3, timeout=LATE_MS)
    all_of.shots("9-champion", "big", "phone", "overlay-bracket")
    winner = big.locator("[data-podium] li .name").first.text_content()
    (champion,) = site.rows(
        "select a.alias from races_entry e join accounts_racer a on a.id = e.racer_id join races_race r on r.id ="
        " e.race_id where r.slug = 'knock-out' order by e.points desc limit 1"
    )
    assert winner == champion[0]
    assert not all_of.wrong
    assert not re.search("Traceback", site.said), site.said[-5000:]

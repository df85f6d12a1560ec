"""Pages that move by themselves, in real browsers on a site with its stream process."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Callable, Iterator
from datetime import timedelta
from itertools import pairwise

import pytest
from django.core.files.storage import default_storage
from django.utils import timezone

from races.entries.services.entries import accept_invitation, remove_entry
from races.entries.services.submissions import submit_model
from races.events import record_board
from races.live.services import launch, pause_live, set_message
from races.models import Visibility
from tests.collected import collected
from tests.evaluation.processes import wait_for
from tests.factories import a_model, a_race, a_racer, drive, laps, start
from tests.live_shows import a_live_race, a_show, begun, slot_of
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.pages.test_screens_browser import compute
from tests.streams.process import Streams, served
from tests.streams.proxy import CUTS, HOLDS, PASSES, REFUSES, before

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
MESSAGES = """addEventListener("DOMContentLoaded", () => {
  window.messages = [];
  new MutationObserver((changes) => changes.forEach(({ target }) => {
    const region = target.closest && target.closest("[data-live-said]");
    if (region) window.messages.push([performance.now(), region.textContent]);
  })).observe(document, { subtree: true, childList: true });
});"""
FIRST = "() => document.querySelector('table.board tr.linked a.name')?.textContent === 'bob'"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture(scope="module")
def site(browser, process: Streams) -> Iterator[str]:
    """The address of a web server beside the stream process."""
    process.environment |= collected()
    with served(process) as port:
        yield f"http://127.0.0.1:{port}"


@pytest.fixture
def looks_at(browser, site: str, streams: Streams) -> Iterator[Callable]:
    """Open a page as somebody, in a browser of their own; its stream is there."""
    contexts = []

    def look(path: str, racer=None, *, at: str = site, **options):
        before = streams.figures()["streams"]
        contexts.append(visitor(browser, at, racer, **options))
        page = contexts[-1].new_page()
        page.add_init_script(MESSAGES)
        page.problems = []
        page.on("console", lambda said: page.problems.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: page.problems.append(str(error)))
        page.goto(path)
        wait_for(lambda: streams.figures()["streams"] == before + 1, 20, streams.log)
        return page

    yield look
    for context in contexts:
        context.close()
    wait_for(lambda: not (streams.figures() or {}).get("streams"), 20, streams.log)


def aliases(page) -> list[str]:
    return page.locator("table.board tr.linked a.name").all_text_contents()


def test_a_result_moves_the_boards_of_guests_and_racers(looks_at, now) -> None:
    race, ann, bob = a_race(now), a_racer("ann"), a_racer("bob")
    drive(race, ann, laps(9_000, 9_100, 9_200), now)
    at = race.get_absolute_url()
    guest, racer = looks_at(at), looks_at(at, ann)
    guest.locator("table.board tr.linked a.name").focus()
    guest.evaluate(
        """() => {
          window.focused = document.activeElement;
          window.slid = 0;
          document.querySelector("tr.linked").animate = () => { window.slid += 1; };
        }"""
    )
    drive(race, bob, laps(8_000, 8_100, 8_200), now)
    for page in (guest, racer):
        page.wait_for_function(FIRST)
        assert aliases(page) == ["bob", "ann"]
    assert guest.evaluate("document.activeElement === window.focused && window.focused.textContent") == "ann"
    guest.wait_for_function("() => window.messages.some(([, text]) => text.includes('bob: 0:08.100.'))")
    racer.wait_for_function("() => document.querySelector('#race-facts').textContent.includes('2 of 2')")
    assert racer.locator("tr.linked.me a.name").text_content() == "ann"
    assert all(later - earlier >= 1_950 for earlier, later in pairwise(guest.evaluate("messages.map(([at]) => at)")))
    assert guest.evaluate("window.slid") >= 1, "its row went down"
    assert guest.problems == racer.problems == []


def test_nothing_slides_where_motion_is_unwelcome(looks_at, now) -> None:
    race, ann = a_race(now), a_racer("ann")
    drive(race, ann, laps(9_000, 9_100, 9_200), now)
    page = looks_at(race.get_absolute_url(), reduced_motion="reduce")
    page.evaluate("() => { Element.prototype.animate = () => { window.slid = true; }; }")
    drive(race, a_racer("bob"), laps(8_000, 8_100, 8_200), now)
    page.wait_for_function(FIRST)
    assert page.evaluate("window.slid === undefined")
    assert page.evaluate("document.querySelector('#board').getAnimations({ subtree: true }).length") == 0


def test_home_tells_who_is_on_track_and_who_is_next(looks_at, now) -> None:
    race, ann, bob = a_race(now, name="Tonight"), a_racer("ann"), a_racer("bob")
    page = looks_at("/")
    assert page.locator("#on-track li").count() == 0
    first = submit_model(race=race, racer=ann, model=a_model(ann), now=now)
    submit_model(race=race, racer=bob, model=a_model(bob), now=now)
    page.locator("#on-track ol li", has_text="bob").wait_for()
    start(first.evaluation, now)
    record_board(race)
    page.locator("#on-track ul li", has_text="ann").wait_for()
    assert page.locator("#on-track ol li").count() == 1 and page.problems == []


def test_tabs_of_a_browser_share_a_stream_which_goes_with_the_last(looks_at, streams, now) -> None:
    race = a_race(now)
    page = looks_at(race.get_absolute_url())
    others = [page.context.new_page() for _ in range(3)]
    for other in others:
        other.goto("/")
    wait_for(lambda: streams.figures()["streams"] == 1, 20, streams.log)
    drive(race, a_racer("bob"), laps(8_000, 8_100, 8_200), now)
    for each in (page, others[0]):
        each.get_by_text("bob").first.wait_for()
    page.context.close()
    wait_for(lambda: streams.figures()["streams"] == 0, 20, streams.log)


def test_pages_ask_by_themselves_while_the_process_is_away_and_come_back(looks_at, streams, now) -> None:
    race = a_race(now)
    page = looks_at(race.get_absolute_url())
    streams.end(signal.SIGKILL)
    drive(race, a_racer("bob"), laps(8_000, 8_100, 8_200), now)
    page.get_by_text("bob").first.wait_for()
    streams.start()
    wait_for(lambda: streams.figures()["streams"] == 1, 60, streams.log)
    drive(race, a_racer("carol"), laps(8_500, 8_600, 8_700), now)
    page.get_by_text("carol").first.wait_for()


def test_who_is_removed_from_a_race_is_shown_it_no_more(looks_at, now) -> None:
    owner, ann = a_racer("owner"), a_racer("ann")
    race = a_race(now, organiser=owner, visibility=Visibility.INVITATION)
    entry = accept_invitation(token=race.invitation, racer=ann, now=now)
    page = looks_at(race.get_absolute_url(), ann)
    assert page.locator("#board").count() == 1
    remove_entry(entry=entry, by=owner, now=now)
    page.locator("#board").wait_for(state="detached")


@pytest.fixture
def on_track(streams, folder, now):
    """A live event with a run of almost a minute that has been on track for some seconds."""
    alice = a_racer("alice")
    event = begun(a_show(now, alice, ["bob"], race=a_live_race(now, alice, slug="race-night")), alice, now)
    compute(event)
    shutil.copytree(default_storage.location, folder / "data" / "files", dirs_exist_ok=True)  # the processes' own
    launch(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now - timedelta(seconds=14))
    return event


FEED = "() => document.querySelector('[data-show]').show.feed"
# steps of the run that the page has, from the first one: a second apart at most, so that no chunk is missing
GAP = """() => {
  const { t } = document.querySelector("[data-show]").show.car.columns;
  return Math.max(...t.slice(1).map((each, at) => each - t[at]));
}"""


def plays(page, by: int = 4) -> None:
    """So many chunks more come."""
    page.wait_for_function(f"{FEED}.after > {page.evaluate(f'{FEED}.after') + by}", timeout=60_000)


def says(event, page, words: str) -> None:
    """What an organiser says comes to the page."""
    set_message(event=event, message=words, by=event.race.organiser, seen=None, now=timezone.now())
    page.locator("#live-message", has_text=words).wait_for(timeout=60_000)


@pytest.mark.soak
def test_a_live_page_plays_on_whatever_a_proxy_does_to_its_stream(looks_at, site, on_track) -> None:
    with before(int(site.rpartition(":")[2])) as proxy:
        proxy.does = HOLDS
        page = looks_at("/races/race-night/event/", at=proxy.address)
        plays(page)
        proxy.does = REFUSES
        says(on_track, page, "Behind a wall")
        plays(page)
        assert page.evaluate(f"{FEED}.streams") is False
        proxy.does = PASSES
        page.wait_for_function(f"{FEED}.streams", timeout=60_000)
        plays(page)
        begun, proxy.does = proxy.streams, CUTS
        says(on_track, page, "Cut again and again")
        wait_for(lambda: proxy.streams > begun, 60)
        plays(page, 6)
        assert page.evaluate(GAP) < 200, "no step is missing"
        assert page.problems == [] or all("502" in said or "ERR_" in said for said in page.problems), page.problems


@pytest.mark.soak
def test_a_live_show_goes_on_without_the_broker(looks_at, server, on_track) -> None:
    page = looks_at("/races/race-night/event/")
    page.wait_for_function(f"{FEED}.streams")
    plays(page)
    server.stop()
    try:
        plays(page, 6)
        says(on_track, page, "Without a broker")
        assert page.evaluate(GAP) < 200
    finally:
        server.start()
    says(on_track, page, "With it")
    plays(page)


def test_a_live_page_asks_for_nothing_but_while_the_process_is_away(looks_at, streams, on_track) -> None:
    """Neither for the state nor for poses; without the process the run is played on all the same."""
    page, asked = looks_at("/races/race-night/event/"), []
    page.on("request", lambda request: asked.append(request.url) if ".json" in request.url else None)
    feed = FEED

    def plays_on(by: int = 4) -> None:
        plays(page, by)

    page.wait_for_function(f"{feed}.streams")
    plays_on()
    asked.clear()
    plays_on()
    set_message(event=on_track, message="Hello", by=on_track.race.organiser, seen=None, now=timezone.now())
    page.locator("#live-message", has_text="Hello").wait_for()
    assert asked == [], "the stream tells it all"
    streams.end(signal.SIGKILL)
    page.wait_for_function(f"{feed}.streams === false")
    plays_on()
    assert any("poses.json" in url for url in asked) and any("state.json" in url for url in asked)
    set_message(event=on_track, message="Still here", by=on_track.race.organiser, seen=None, now=timezone.now())
    page.locator("#live-message", has_text="Still here").wait_for()
    streams.start()
    page.wait_for_function(f"{feed}.streams", timeout=60_000)
    plays_on(2)
    asked.clear()
    plays_on()
    assert asked == [] and page.evaluate("document.querySelectorAll('[data-car]').length") == 1


def test_the_commentator_follows_the_stream(looks_at, streams, on_track) -> None:
    """A sentence is asked for once it was played, nothing while nothing happens; all goes on without the process."""
    page, asked = looks_at("/races/race-night/live/commentary/"), []
    told = page.locator("#told")
    page.on("request", lambda request: asked.append(request.url))
    page.wait_for_function(f"{FEED}.streams")
    page.evaluate(
        """() => {
          window.happened = 0;
          document.querySelector("[data-show]").addEventListener("show:event", () => { window.happened += 1; });
        }"""
    )
    asked.clear()
    begun = told.locator("li").count()
    page.wait_for_function(f"() => document.querySelectorAll('#told li').length > {begun + 1}", timeout=60_000)
    assert {url.partition("/races/")[2] for url in asked} <= {"race-night/live/commentary/", ""}, "no state, no poses"
    assert len(asked) <= page.evaluate("window.happened") + 2
    set_message(event=on_track, message="Hello", by=on_track.race.organiser, seen=None, now=timezone.now())
    told.locator("li", has_text="Organiser: Hello").wait_for()
    streams.end(signal.SIGKILL)
    page.wait_for_function(f"{FEED}.streams === false")
    set_message(event=on_track, message="Still here", by=on_track.race.organiser, seen=None, now=timezone.now())
    told.locator("li", has_text="Still here").wait_for(timeout=60_000)
    streams.start()
    page.wait_for_function(f"{FEED}.streams", timeout=60_000)
    assert page.locator("#facts").get_by_text("bob").count() and not page.locator("#told[hx-get]").count()


def test_what_the_car_sees_comes_by_the_stream(looks_at, streams, on_track) -> None:
    """Who opens the panel asks for what was played before and then for nothing, unless there is no stream."""
    page, asked = looks_at("/races/race-night/event/"), []
    page.on("request", lambda request: asked.append(request.url) if "frames.png" in request.url else None)
    page.wait_for_function(f"{FEED}.streams")
    page.evaluate(
        """() => {
          window.drawn = 0;
          const draw = CanvasRenderingContext2D.prototype.drawImage;
          CanvasRenderingContext2D.prototype.drawImage = function (...given) {
            window.drawn += 1;
            return draw.apply(this, given);
          };
        }"""
    )

    def draws(by: int) -> None:
        page.wait_for_function(f"() => window.drawn > {page.evaluate('window.drawn') + by}", timeout=60_000)

    page.locator("[data-frames] summary").click()
    draws(8)
    asked.clear()
    draws(10)
    assert asked == []
    page.locator("[data-frames] summary").click()
    page.locator("[data-frames][data-follow]").wait_for(state="detached")  # the browser tells a moment later
    page.locator("[data-frames] summary").click()
    streams.end(signal.SIGKILL)
    draws(8)
    assert asked, "without the stream the page asks"
    streams.start()
    page.wait_for_function(f"{FEED}.streams", timeout=60_000)
    assert page.problems == [] or all("ERR_" in said or "50" in said for said in page.problems), page.problems


def test_the_console_follows_the_stream(looks_at, on_track) -> None:
    """What another organiser does comes by itself; while nothing is computed or counted down, it asks only then."""
    alice, asked = on_track.race.organiser, []
    page = looks_at("/races/race-night/event/console/", alice)
    page.on("request", lambda request: asked.append(request.url) if "console" in request.url else None)
    page.locator("#console:not([data-waits])").wait_for()
    set_message(event=on_track, message="Dinner is at eight.", by=alice, seen=None, now=timezone.now())
    page.locator('#console [data-act="message"]').wait_for()
    assert len(asked) <= 3
    pause_live(event=on_track, by=alice, seen=None, now=timezone.now())
    page.get_by_role("button", name="Continue", exact=True).wait_for()
    assert page.problems == []

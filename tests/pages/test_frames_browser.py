"""What a frame of a live run costs a real browser: counted, not timed, so that a busy machine changes nothing."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta

import pytest
from django.utils import timezone

from races.live.services import launch
from races.models import LiveEvent
from tests.factories import a_racer
from tests.live_shows import a_live_race, a_show, begun, slot_of
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.pages.test_screens_browser import compute

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
# Draw two seconds of a run as 120 frames, laid out after each: what was changed, and how often.
DRAWN = """() => {
  const show = document.querySelector("[data-show]").show;
  const seen = { texts: 0, trees: 0, attributes: {} };
  const note = (changes) => changes.forEach(({ type, attributeName, target }) => {
    if (type === "characterData") seen.texts += 1;
    else if (type === "childList") seen.trees += 1;
    else {
      const of = `${target.getAttribute("class")} ${attributeName}`;
      seen.attributes[of] = (seen.attributes[of] || 0) + 1;
    }
  });
  const watch = new MutationObserver(note);
  watch.observe(document, { subtree: true, childList: true, characterData: true, attributes: true });
  show.drawn = [];
  for (let frame = 0; frame < 120; frame += 1) {
    const moment = 2000 + frame * 1000 / 60;
    show.frame(moment);
    void document.body.offsetHeight;
    show.drawn.push(document.querySelector('[data-car="0"]').style.transform);
  }
  note(watch.takeRecords());
  watch.disconnect();
  return { ...seen, places: new Set(show.drawn).size };
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def event(browser, wakes) -> LiveEvent:
    """Bob is on track since five seconds."""
    now, alice = timezone.now(), a_racer("alice")
    event = begun(a_show(now, alice, ["bob"], race=a_live_race(now, alice, slug="race-night")), alice, now)
    compute(event)
    then = timezone.now() - timedelta(seconds=15)
    launch(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=then)
    return event


@pytest.mark.parametrize(
    ("path", "width"), [("live/phone/", 360), pytest.param("live/screen/", 1920, marks=pytest.mark.soak)]
)
def test_a_frame_moves_the_car_and_lays_nothing_out(browser, live_server, event, path, width):
    page = visitor(browser, live_server.url, viewport={"width": width, "height": width * 9 // 16 + 400}).new_page()
    page.goto(f"/races/race-night/{path}")
    page.wait_for_function(
        """() => {
          const { car } = document.querySelector("[data-show]").show;
          return car?.columns.t.at(-1) > 4100 && document.querySelector('[data-car="0"]')?.style.transform;
        }"""
    )
    page.evaluate("() => { document.querySelector('[data-show]').show.draw = () => {}; }")
    page.wait_for_timeout(100)
    counted = page.context.new_cdp_session(page)
    counted.send("Performance.enable")

    def layouts() -> float:
        return {each["name"]: each["value"] for each in counted.send("Performance.getMetrics")["metrics"]}[
            "LayoutCount"
        ]

    before = layouts()
    drawn = page.evaluate(DRAWN)
    assert drawn["places"] == 120, "each frame has a place of its own"
    # figures ten times a second, the tail with each of the fifteen steps; a car at each frame, by its transform
    assert drawn["trees"] == 0
    assert drawn["texts"] <= 20 * 3
    moved = {of: count for of, count in drawn["attributes"].items() if count > 40}
    assert moved == {"mover replay-car style": 120}
    assert drawn["attributes"]["replay-tail points"] <= 31
    assert layouts() - before <= 20 + 31 + 2, "most frames lay nothing out"

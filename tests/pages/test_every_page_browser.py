"""Every page in a real Chromium: axe finds nothing wrong in it, the browser complains of nothing, and nothing stands
beyond the edge of a narrow screen. Axe looks at each page once, wide and light or narrow and dark; in `make soak` it
looks at it as everybody, with whatever it shows, both ways, and at its colours in the other theme at each width."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import cycle

import pytest
from django.urls import Resolver404, resolve

from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.pages.test_browser import playwright
from tests.pages.walk import COOKIE, Site, make_site, names_of_pages, names_walked

axe = pytest.importorskip("axe_playwright_python.base", reason="axe is not installed (make dev)")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 360, "height": 780}
# A theme changes colours and nothing else, so that the second theme at a width is judged by the rules of colours.
COLOURS = {"runOnly": ["color-contrast", "link-in-text-block"]}
LOOKS = ((WIDE, "light", {}), (NARROW, "dark", {}), (WIDE, "dark", COLOURS), (NARROW, "light", COLOURS))
EXPECTED = ("/nothing/at/all/", "/accounts/confirm-email/none/")
LOOK = """async ([theme, options]) => {
  document.documentElement.dataset.theme = theme;
  await new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)));
  await Promise.all(document.getAnimations().map((each) => each.finished.catch(() => 0)));
  const report = await axe.run(document, { resultTypes: ["violations"], preload: false, ...options });
  return report.violations.map((rule) => [rule.impact, rule.id, rule.nodes.map((node) => node.target.join(" "))]);
}"""


# A date with the month first, in figures alone, or as ISO 8601: there is one style on all pages, "Sat 28 Nov, 14:32".
OTHER_DATES = r"""() => {
  const months = "(Jan|Feb|Mar|Apr|May|June?|July?|Aug|Sept?|Oct|Nov|Dec)[a-z]*\\.?";
  const other = new RegExp(`${months} \\d{1,2}\\b|\\d{4}-\\d\\d-\\d\\d \\d\\d:|\\d{1,2}[/.]\\d{1,2}[/.]\\d{4}`);
  return document.querySelector("main").innerText.split("\n").filter((line) => other.test(line));
}"""


@pytest.fixture
def site(live_server, wakes, video_wakes, trainings_taken_on) -> Site:
    return make_site()


@pytest.fixture
def browser() -> Iterator[playwright.Browser]:
    with chromium(briefly=True) as opened:
        yield opened


def name_of(path: str) -> str:
    """The name of the page, or the path where there is none."""
    try:
        return resolve(path.partition("?")[0]).view_name
    except Resolver404:
        return path


def look_at(page: playwright.Page, width: dict, theme: str, rules: dict) -> list[str]:
    """What axe finds at this width in this theme."""
    page.set_viewport_size(width)
    return [
        f"{width['width']} px, {theme}: {rule} ({impact}) at {'; '.join(nodes[:4])}"
        for impact, rule, nodes in page.evaluate(LOOK, [theme, rules])
    ]


@pytest.mark.parametrize("looks", [(), pytest.param(LOOKS, marks=pytest.mark.soak)], ids=["in turn", "all"])
def test_every_page_is_accessible_and_logs_no_browser_errors(looks, site, browser, live_server):
    turn = cycle(LOOKS[:2])
    missing = sorted(names_of_pages() - names_walked(site))
    assert not missing, f"pages that are not in tests/pages/walk.py: {missing}"
    wrong: dict[str, list[str]] = {}
    judged: set[str] = set()
    for viewer in sorted(site.paths, key=lambda viewer: viewer != "alice"):  # who sees most
        context = browser.new_context(base_url=live_server.url, locale="en-GB", bypass_csp=False)
        session = site.world.client(viewer).cookies.get(COOKIE)
        if session is not None:
            context.add_cookies([{"name": COOKIE, "value": session.value, "url": live_server.url}])
        # sent once, not with each page
        context.add_init_script(f"if (window === window.top) {{\n{axe.AXE_SCRIPT}\n}}")
        page = context.new_page()
        complaints: list[str] = []
        page.on("pageerror", lambda error, to=complaints: to.append(str(error)))
        page.on("console", lambda line, to=complaints: to.append(line.text) if line.type == "error" else None)
        for path in dict.fromkeys(site.paths[viewer]):
            name = name_of(path)
            now = looks or ([] if name in judged else [next(turn)])
            judged.add(name)
            page.set_viewport_size(now[0][0] if now else NARROW)
            answer = page.goto(path)
            found = [each for look in now for each in look_at(page, *look)]
            page.set_viewport_size(NARROW)
            beyond = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            found += [f"a date in another style: {line}" for line in page.evaluate(OTHER_DATES)]
            if beyond > 0:
                found.append(f"{beyond} px stand beyond the edge of a narrow screen")
            for editor in page.locator(".editor-host .cm-content").all():
                editor.press("ControlOrMeta+a")
                page.keyboard.type("x = 1")  # over a selection, which is where a browser writes styles of its own
            if answer.status != 200 and path not in EXPECTED:
                found.append(f"status {answer.status}")
            found += [text for text in complaints if path not in EXPECTED or "status of 404" not in text]
            complaints.clear()
            if found:
                wrong[f"{viewer} {path}"] = found
        context.close()
    assert not wrong, json.dumps(wrong, indent=1, ensure_ascii=False)

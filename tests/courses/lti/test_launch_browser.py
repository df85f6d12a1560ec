"""The walk of a teacher and a student from a platform's course page in a real Chromium, with its cookies and frames."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from courses.models import Assignment, LtiContext, LtiLine
from tests.courses.assignments import an_assignment
from tests.courses.lti.platform import Platform
from tests.pages.browsing import IN_A_BROWSER, chromium

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture
def browser(wakes: list[dict]) -> Iterator[object]:
    with chromium() as opened:
        yield opened


def site_at(host: str, live_server, platform: Platform, settings) -> str:
    """The site under this host: the platform is at 127.0.0.1, so that localhost is another site for a browser."""
    site = live_server.url.replace("localhost", host)
    settings.SITE_URL, settings.CSRF_TRUSTED_ORIGINS = site, [site]
    platform.redirects, platform.log_in_at = [f"{site}/lti/launch/"], f"{site}/lti/log-in/"
    return site


def come_first(page, platform: Platform) -> LtiContext:
    """The teacher opens the tool for the first time, with a new account and a new class."""
    page.goto(f"{platform.base}/course?as=t-1")
    page.click("form[target=_self] button")
    page.click("button:has-text('Create a new account')")
    page.click("button:has-text('A new class')")
    playwright.expect(page.locator("h1")).to_have_text("Reinforcement learning")
    return LtiContext.objects.get()


def test_a_teacher_and_a_student_come_from_another_site(browser, live_server, registered, platform, settings):
    site = site_at("localhost", live_server, platform, settings)
    teacher, student = browser.new_context(), browser.new_context(viewport={"width": 360, "height": 800})
    context = come_first(teacher.new_page(), platform)
    page = student.new_page()
    page.goto(f"{platform.base}/course?as=s-1")
    page.click("form[target=_self] button")
    page.wait_for_url(f"{site}/assignments/")
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    assert context.group.classroom.learners.get().real_name == "Ada Lovelace"


def test_a_teacher_chooses_an_assignment_in_the_platforms_frame(
    browser, live_server, registered, platform, settings, now
):
    site_at("127.0.0.1", live_server, platform, settings)
    page = browser.new_page()
    context = come_first(page, platform)
    made: Assignment = an_assignment(context.group, now)
    page.goto(f"{platform.base}/course?as=t-1")
    page.click("button:has-text('Choose')")
    inside = page.frame_locator("iframe")
    inside.locator("button:has-text('First')").click()
    playwright.expect(inside.locator("h1")).to_have_text("Chosen")
    (chosen,) = platform.chosen
    platform.link = chosen["https://purl.imsglobal.org/spec/lti-dl/claim/content_items"][0]["custom"]
    assert platform.link == {"assignment": made.public_id}

    page.goto(f"{platform.base}/course?as=t-1")
    page.click("button:has-text('Open here')")
    with page.context.expect_page() as opened:
        inside.locator("a.button").click()
    opened.value.wait_for_url("**/assignments/**")
    assert LtiLine.objects.get().assignment == made

"""Where reading begins after a page has loaded, and what a page keeps up to date, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta

import pytest
from django.utils import timezone

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.submissions import submit_model
from tests.factories import a_model, a_race, a_racer, a_track, laps, outcome, start
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.training.jobs import a_training
from training.models import JobState, TrainingJob

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
FOCUSED = "document.activeElement.name || document.activeElement.nodeName"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def now(browser, wakes, trainings_taken_on) -> datetime:
    return timezone.now()


def test_a_form_begins_at_its_first_field_and_other_pages_at_their_heading(browser, live_server, now) -> None:
    with visitor(browser, live_server.url) as context:
        page = context.new_page()
        for address, name in (("/accounts/signup/", "username"), ("/accounts/login/", "login")):
            page.goto(address)
            assert page.evaluate(FOCUSED) == name
        page.goto("/about/")
        assert page.evaluate(FOCUSED) == "H1" and page.evaluate("scrollY") == 0
        page.goto("/about/#rules")
        page.reload()
        assert page.evaluate(FOCUSED) != "H1", "the address names another place"
        page.goto("/races/")
        page.keyboard.press("Tab")
        playwright.expect(page.get_by_text("Skip to the content")).to_be_focused()
        page.get_by_role("contentinfo").get_by_role("link", name="How it works").click()
        page.wait_for_url("**/about/")
        assert page.evaluate(FOCUSED) == "H1"
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.closest('#main') !== null")


def test_the_alias_field_names_its_format(browser, live_server, now) -> None:
    with visitor(browser, live_server.url) as context:
        page = context.new_page()
        page.goto("/accounts/signup/")
        alias = page.get_by_label("Alias")
        alias.fill("two words")
        page.locator("[name=email]").fill("new@example.org")
        page.locator("[name=password1]").fill("lane-9-apex")
        page.locator("[name=password2]").fill("lane-9-apex")
        page.get_by_role("main").get_by_role("button", name="Sign up").click()
        message = "2 to 64 English letters, digits, hyphens and underscores."
        assert alias.evaluate("field => field.validationMessage") == message
        alias.fill("two-words")
        assert alias.evaluate("field => field.checkValidity()")


def test_choosing_sac_selects_ranges_and_ppo_brings_the_table_back(browser, live_server, now) -> None:
    a_track()
    with visitor(browser, live_server.url, a_racer("alice")) as context:
        page = context.new_page()
        page.goto("/train/new/")
        table, ranges = page.locator("[name=action_space_type]").nth(0), page.locator("[name=action_space_type]").nth(1)
        assert table.is_checked()
        page.locator("[name=algorithm][value=sac]").check()
        assert ranges.is_checked() and table.is_disabled()
        playwright.expect(page.get_by_role("spinbutton", name="Steering to the left")).to_be_visible()
        page.locator("[name=algorithm][value=ppo]").check()
        assert table.is_checked() and table.is_enabled()
        page.goto("/train/new/?algorithm=sac")
        assert ranges.is_checked()


def test_a_run_that_finishes_is_shown_on_the_open_page_of_its_training(browser, live_server, now) -> None:
    alice, track = a_racer("alice"), a_track()
    race = a_race(now, track=track, name="Evening race", closes_at=now + timedelta(days=1))
    model, job = a_model(alice), a_training(alice, track, now, name="Night-shift")
    ended = {"state": JobState.FINISHED, "ended_because": "time", "lease": None, "leased_until": None}
    TrainingJob.objects.filter(pk=job.pk).update(
        **ended, ended_at=now, steps_done=2000, seconds_done=6.0, best_model=model, last_model=model
    )
    run = start(submit_model(race=race, racer=alice, model=model, now=now).evaluation, now)
    with visitor(browser, live_server.url, alice) as context:
        for address in (job.get_absolute_url(), model.get_absolute_url()):
            page = context.new_page()
            page.goto(address)
            assert page.locator(f"a.pill.running[href='{run.get_absolute_url()}']").first.inner_text() == "on track"
        running = Evaluation.objects.get(pk=run.pk)
        driven = outcome(laps(10_000, 10_000, 10_000))
        assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=driven, now=now)
        for page in context.pages:
            page.bring_to_front()
            finished = page.locator(f"a.pill.finished[href='{run.get_absolute_url()}']")
            playwright.expect(finished).to_be_visible(timeout=20_000)

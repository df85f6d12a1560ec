"""A racer chooses in a real browser whose weights a training begins with."""

from __future__ import annotations

import pytest
from django.utils import timezone

from league.house_cars.services import enter_house_cars, house_racer
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from training.models import TrainingJob

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


def test_a_racer_chooses_the_start_in_a_browser(live_server, wakes, trainings_taken_on) -> None:
    racer, now = a_racer("learner"), timezone.now()
    a_race(now, organiser=house_racer(name="paddock", display_name="Paddock", now=now))
    enter_house_cars(now=now)
    with chromium() as browser, visitor(browser, live_server.url, racer) as context:
        page = context.new_page()
        page.goto("/train/new/")
        house, models = page.get_by_label("a house car that already drives"), page.get_by_label("Model", exact=True)
        playwright.expect(house).to_be_checked()
        playwright.expect(models).to_be_hidden()
        page.get_by_label("another model").check()
        models.select_option(label="Brisk (Brisk)")
        house.check()
        page.get_by_label("Name", exact=True).fill("Faster")
        page.get_by_role("button", name="Create and train").click()
        playwright.expect(page.get_by_role("definition").filter(has_text="Steady")).to_be_visible()
    assert TrainingJob.objects.get(name="Faster").cloned_from.name == "Steady"

"""Whoever was logged out meanwhile and sends a form comes back to the page that it is on, not to an error."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import timezone

from races.models import Entry
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

PASSWORD = "a long enough passphrase"

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


def test_a_racer_logs_in_once_more_and_enters_the_race(live_server) -> None:
    now = timezone.now()
    race = a_race(now, slug="next-race", opens_at=now + timedelta(days=1), closes_at=now + timedelta(days=2))
    racer = a_racer("sleeper")
    racer.set_password(PASSWORD)
    racer.save()
    with chromium() as browser:
        page = visitor(browser, live_server.url, racer).new_page()
        page.goto(race.get_absolute_url())
        page.context.clear_cookies(name="sessionid")
        page.locator("form[action$='/enter/'] button").click()
        page.get_by_label("Alias or e-mail address").fill("sleeper")
        page.get_by_label("Password").fill(PASSWORD)
        page.get_by_role("main").get_by_role("button", name="Log in").click()
        page.locator("form[action$='/enter/'] button").click()
        page.get_by_text("You have joined.").wait_for()
        assert page.url == live_server.url + race.get_absolute_url()
    assert Entry.objects.get().racer == racer

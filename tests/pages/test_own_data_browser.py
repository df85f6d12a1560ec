"""A racer changes the alias, downloads all data and deletes the account, in a real browser."""

from __future__ import annotations

import json
import zipfile

import pytest
from django.core.cache import cache
from django.utils import timezone

from accounts.models import Racer
from tests.factories import a_race, drive, laps
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

PASSWORD = "a long enough passphrase"
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


def test_a_racer_renames_downloads_and_leaves(live_server, settings, wakes, tmp_path) -> None:
    cache.clear()
    settings.SITE_URL = live_server.url
    racer = Racer.objects.create_user("ayrton", "ayrton@example.org", PASSWORD)
    race = a_race(timezone.now(), name="Sunday race")
    drive(race, racer, laps(10_000, 10_100, 10_200), timezone.now())
    with chromium() as browser:
        context = visitor(browser, live_server.url, accept_downloads=True)
        page = context.new_page()
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))

        def press(name: str, role: str = "button") -> None:
            page.get_by_role("main").get_by_role(role, name=name, exact=True).click()

        page.goto("/accounts/login/")
        page.get_by_label("Alias or e-mail address").fill("ayrton")
        page.get_by_label("Password", exact=True).fill(PASSWORD)
        press("Log in")
        page.get_by_text("Welcome, ayrton").wait_for()

        # another alias: old results show it, and the old address leads to it
        page.goto("/settings/")
        press("Change your alias", "link")
        page.get_by_label("New alias").fill("steward")
        press("Change the alias")
        page.get_by_text("This alias is reserved.").wait_for()
        page.get_by_label("New alias").fill("senna")
        press("Change the alias")
        page.get_by_text("Next change possible").wait_for()
        page.goto(race.get_absolute_url())
        page.get_by_role("row").get_by_text("senna", exact=True).first.wait_for()
        page.goto("/racers/ayrton/")
        assert page.url.endswith("/racers/senna/")

        # all data: what the zip has is the racer's
        page.goto("/settings/data/")
        press("Download (zip)")
        page.get_by_label("Password", exact=True).fill(PASSWORD)
        with page.expect_download() as download:
            press("Continue")
        packed = tmp_path / download.value.suggested_filename
        download.value.save_as(packed)
        with zipfile.ZipFile(packed) as archive:
            assert archive.testzip() is None and packed.name.startswith("paddock-senna-")
            assert json.loads(archive.read("past_aliases.json"))[0]["alias"] == "ayrton"

        # the account: the wrong word keeps it, the right one deletes it
        page.goto("/settings/data/")
        press("Delete account…", "link")
        page.get_by_label("Type your alias to confirm").fill("ayrton")
        press("Delete my account")
        page.get_by_text("Type your alias exactly to confirm.").wait_for()
        page.get_by_label("Type your alias to confirm").fill("senna")
        press("Delete my account")
        page.get_by_text("Your account is deleted.").wait_for()
        page.goto(race.get_absolute_url())
        page.get_by_role("row").get_by_text(f"Deleted racer {racer.pk}").first.wait_for()
        assert "senna" not in page.content() and "ayrton" not in page.content()
        for alias in ("senna", "ayrton"):
            assert page.goto(f"/racers/{alias}/").status == 404
    assert wrong == []


def test_a_session_that_is_not_fresh_asks_for_the_password(live_server, settings, wakes) -> None:
    cache.clear()
    settings.SITE_URL = live_server.url
    racer = Racer.objects.create_user("niki", "niki@example.org", PASSWORD)
    with chromium() as browser:
        page = visitor(browser, live_server.url, racer).new_page()
        page.goto("/settings/data/delete/")
        page.get_by_label("Type your alias to confirm").fill("niki")
        page.get_by_role("button", name="Delete my account").click()
        page.get_by_label("Password", exact=True).fill(PASSWORD)
        assert Racer.objects.filter(alias="niki").exists()
        page.get_by_role("main").get_by_role("button", name="Continue").click()
        page.get_by_text("Your account is deleted.").wait_for()
    assert not Racer.objects.filter(alias="niki").exists()

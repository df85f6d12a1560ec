"""A person's whole way in a real Chromium: from the button to the provider, to an alias, out, and in again."""

from __future__ import annotations

import pytest
from django.conf import settings as site
from playwright.sync_api import Page, expect

from accounts.models import Racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

from .provider_site import PASSWORD

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
BUTTON = "Log in with Example University"


def press(page: Page, name: str) -> None:
    page.get_by_role("main").get_by_role("button", name=name, exact=True).click()


def test_from_the_button_to_an_alias_out_and_in_again(live_server, provider, settings):
    settings.SITE_URL = live_server.url
    provider.says("newcomer", preferred_username="newcomer")
    with chromium() as browser:
        page = visitor(browser, live_server.url).new_page()
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)

        page.goto("/accounts/login/?next=/races/")
        press(page, BUTTON)
        page.wait_for_url(f"{site.OIDC['issuer']}/log-in/**")
        page.get_by_label("Username").fill("newcomer")
        page.get_by_label("Password").fill(PASSWORD)
        page.get_by_role("button", name="Sign in at the provider").click()

        page.get_by_role("heading", name="Choose your alias").wait_for()
        expect(page.get_by_label("Alias")).to_have_value("newcomer")
        expect(page.get_by_label("E-mail address")).to_be_disabled()
        page.get_by_label("Alias").fill("root")
        press(page, "Sign up")
        page.get_by_text("This alias is reserved.").wait_for()
        page.get_by_label("Alias").fill("Quick-One")
        press(page, "Sign up")
        page.wait_for_url("**/races/")
        page.get_by_text("Quick-One").first.wait_for()
        assert Racer.objects.get().email == "newcomer@example.org"

        page.goto("/accounts/logout/")
        press(page, "Log out")
        page.get_by_text("You are logged out.").wait_for()

        # the provider still knows the browser: one press is enough
        page.goto("/accounts/login/")
        press(page, BUTTON)
        page.get_by_text("Welcome, Quick-One").wait_for()

        page.goto("/accounts/3rdparty/")
        page.get_by_role("heading", name="Example University").wait_for()
    assert wrong == []
    assert Racer.objects.count() == 1

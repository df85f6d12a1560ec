"""Passkeys and codes in a real browser, whose authenticator is a virtual one."""

from __future__ import annotations

import re

import pytest
from django.core.cache import cache

from accounts.models import Racer
from tests.accounts.one_time_codes import code_of
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

PASSWORD = "a long enough passphrase"
AUTHENTICATOR = {
    "protocol": "ctap2",
    "transport": "internal",
    "hasResidentKey": True,
    "hasUserVerification": True,
    "isUserVerified": True,
    "automaticPresenceSimulation": True,
}
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


def test_a_racer_logs_in_with_a_passkey_and_with_an_app(live_server, settings) -> None:
    cache.clear()
    settings.SITE_URL = live_server.url
    Racer.objects.create_user("alice", "alice@example.org", PASSWORD)
    with chromium() as browser:
        context = visitor(browser, live_server.url)
        page = context.new_page()
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
        device = context.new_cdp_session(page)
        device.send("WebAuthn.enable")
        device.send("WebAuthn.addVirtualAuthenticator", {"options": AUTHENTICATOR})

        def press(name: str, role: str = "button") -> None:
            page.get_by_role("main").get_by_role(role, name=name, exact=True).click()

        def log_in() -> None:
            page.goto("/accounts/login/")
            page.get_by_label("Alias or e-mail address").fill("alice")
            page.get_by_label("Password", exact=True).fill(PASSWORD)
            press("Log in")

        def log_out() -> None:
            page.goto("/accounts/logout/")
            press("Log out")
            page.get_by_text("You are logged out.").wait_for()

        # a passkey, after the password once more
        log_in()
        page.goto("/accounts/2fa/")
        press("Add a passkey", "link")
        page.get_by_label("Password", exact=True).fill(PASSWORD)
        press("Continue")
        page.get_by_label("Log in with the passkey only, without the password").check()
        press("Add a passkey")
        page.get_by_role("heading", name="Recovery codes").wait_for()
        codes = re.findall(r"\d{8}", page.locator("main pre").inner_text())
        assert len(codes) == 10

        # with it alone
        log_out()
        page.goto("/accounts/login/")
        press("With a passkey")
        page.get_by_text("Welcome, alice").wait_for()

        # with the password and it
        log_out()
        log_in()
        press("Use a passkey")
        page.get_by_text("Welcome, alice").wait_for()

        # it shows who is there, and an app is set up
        page.goto("/accounts/2fa/totp/activate/")
        press("with a passkey", "link")
        press("Use a passkey")
        secret = page.locator("#totp-secret").input_value()
        assert page.locator("img.qr").evaluate("image => image.naturalWidth") > 0
        page.get_by_label("Authenticator code").fill(code_of(secret))
        press("Set it up")
        page.get_by_text("Set up.", exact=True).wait_for()

        # a name, and no more of it
        press("Manage passkeys", "link")
        page.get_by_role("link", name="Rename").click()
        page.get_by_label("Name").fill("Blue key")
        press("Save")
        page.goto("/accounts/2fa/webauthn/")
        page.get_by_role("rowheader", name="Blue key").wait_for()
        page.get_by_role("link", name="Remove Blue key").click()
        press("Remove the passkey")
        page.get_by_text("Passkey removed.").wait_for()

        # with a code on paper; new ones void the old
        log_out()
        log_in()
        page.get_by_label("Code").fill(codes[0])
        press("Log in")
        page.get_by_text("Welcome, alice").wait_for()
        page.goto("/accounts/2fa/recovery-codes/generate/")
        press("with a code", "link")
        page.get_by_label("Code").fill(codes[1])
        press("Continue")
        press("Create new codes")
        page.get_by_role("heading", name="Recovery codes").wait_for()
        assert not set(codes) & set(re.findall(r"\d{8}", page.locator("main pre").inner_text()))

        # no more of the app: the password alone again
        page.goto("/accounts/2fa/totp/deactivate/")
        press("Remove the app")
        page.get_by_text("App removed.").wait_for()
        log_out()
        log_in()
        page.get_by_text("Welcome, alice").wait_for()
    assert wrong == []

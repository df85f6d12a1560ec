"""A real Chromium on the site's pages, served within the tests' own process: what a test writes, the pages show."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from django.test import Client

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext

    from accounts.models import Racer

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
FLAGS += ["--disable-background-networking", "--disable-component-update"]
# Every test in a real browser has these marks.
IN_A_BROWSER = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.xdist_group("browser"),
    pytest.mark.skipif(not CHROMIUM.exists(), reason="Chromium is not installed (apt-get install chromium)"),
]
BACKEND = "django.contrib.auth.backends.ModelBackend"


@contextmanager
def chromium() -> Iterator[Browser]:
    """A Chromium without a window."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        try:
            yield opened
        finally:
            opened.close()


def visitor(browser: Browser, address: str, racer: Racer | None = None, **options: object) -> BrowserContext:
    """A browser of its own for a guest, or for a racer who is logged in."""
    context = browser.new_context(base_url=address, locale="en-GB", **options)
    context.set_default_timeout(30_000)
    if racer is not None:
        client = Client()
        client.force_login(racer, backend=BACKEND)
        context.add_cookies([{"name": "sessionid", "value": client.cookies["sessionid"].value, "url": address}])
    return context

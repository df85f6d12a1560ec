"""A real Chromium on the site's pages, served within the tests' own process: what a test writes, the pages show."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING
from unittest.mock import patch

import pytest
from django.contrib.staticfiles.handlers import StaticFilesHandler
from django.http import HttpRequest
from django.http.response import HttpResponseBase
from django.test import Client

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page

    from accounts.models import Racer


def find_browser() -> str | None:
    """Chromium or Chrome of the system, else Playwright's own. A snap is neither: it cannot read the tests' folders.

    Chromium's headless shell comes first: the same pages and scripts, without windows, for half of the processor time.
    """
    for name in ("chromium-headless-shell", "chromium", "google-chrome", "google-chrome-stable"):
        found = shutil.which(name)
        if found and not found.startswith("/snap/"):
            return found
    folder = Path(os.environ.get("PLAYWRIGHT_BROWSERS_PATH") or Path.home() / ".cache" / "ms-playwright")
    ours = (
        sorted(folder.glob(kind), reverse=True)
        for kind in ("chromium_headless_shell-*/*/*shell", "chromium-*/*/chrome")
    )
    return next(map(str, chain.from_iterable(ours)), None)


CHROMIUM = find_browser()
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
FLAGS += ["--disable-background-networking", "--disable-component-update"]
# A page that follows another keeps its process, and none waits for a page that does not come: a quarter less processor
# time a page. The first of these features are Playwright's own, which a second list takes the place of.
UNUSED = ["AvoidUnnecessaryBeforeUnloadCheckSync", "DestroyProfileOnBrowserClose", "HttpsUpgrades", "MediaRouter"]
UNUSED += ["HttpsFirstBalancedModeAutoEnable", "PaintHolding", "ThirdPartyStoragePartitioning", "OptimizationHints"]
UNUSED += ["AvoidCorsURLLoaderRestartOnRedirect", "NetworkTimeServiceQuerying"]
UNUSED += ["ProactivelySwapBrowsingInstance", "SpareRendererForSitePerProcess"]
FLAGS += [f"--disable-features={','.join(UNUSED)}"]
# For many pages that are looked at once: code that is made faster for long use does not pay for itself there.
BRIEFLY = ["--js-flags=--no-maglev --no-turbofan --single-threaded-gc"]
# Every test in a real browser has these marks.
IN_A_BROWSER = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium or Chrome; “make test” says what to type"),
]
SHOTS = os.environ.get("PADDOCK_SHOTS")
LATE_MS = 20_000  # what a page shows comes later on a busy machine
ASYNC_UNSAFE = "DJANGO_ALLOW_ASYNC_UNSAFE"
BACKEND = "django.contrib.auth.backends.ModelBackend"


_SERVE = StaticFilesHandler.serve


def _kept(handler: StaticFilesHandler, request: HttpRequest) -> HttpResponseBase:
    """Browsers keep styles and scripts, as those of a real site: none changes while the tests run."""
    answer = _SERVE(handler, request)
    answer.headers.setdefault("Cache-Control", "max-age=600")
    return answer


class _Shared:
    """The one Chromium of a process: starting one takes longer than most of what is done in it."""

    def __init__(self) -> None:
        self._held: ExitStack | None = None
        self._browser: Browser | None = None

    def have(self, *more: str) -> Browser:
        if self._browser is None or not self._browser.is_connected():
            self.close()
            playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
            playwright.expect.set_options(timeout=LATE_MS)
            with ExitStack() as held:
                driver = held.enter_context(playwright.sync_playwright())
                self._browser = driver.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, *more])
                held.callback(self._browser.close)
                # Playwright's loop runs in this thread until it is closed, and the tests read the database beside it
                held.enter_context(patch.object(StaticFilesHandler, "serve", _kept))
                held.callback(os.environ.pop, ASYNC_UNSAFE, None)
                os.environ[ASYNC_UNSAFE] = "true"
                self._held = held.pop_all()
        return self._browser

    def close(self) -> None:
        held, self._held, self._browser = self._held, None, None
        if held is not None:
            held.close()


_SHARED = _Shared()


@contextmanager
def chromium(new: bool = False, briefly: bool = False) -> Iterator[Browser]:
    """A Chromium without a window, in which nothing is open: that of the test before, where there was one.

    ``new``: one that has just been started. In one that has had a service worker before, a network that a test cuts
    was seen to let requests through. ``briefly``: one for this test alone, which looks at many pages once.
    """
    if new or briefly:
        _SHARED.close()
    opened = _SHARED.have(*(BRIEFLY if briefly else []))
    before = opened.contexts
    try:
        yield opened
    finally:
        for context in opened.contexts:
            if context not in before:
                context.close()
        if briefly:
            _SHARED.close()


def after(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Close the Chromium when the next test needs none: some of them start loops of their own."""
    if nextitem is None or nextitem.get_closest_marker("browser") is None:
        _SHARED.close()


def visitor(browser: Browser, address: str, racer: Racer | None = None, **options: object) -> BrowserContext:
    """A browser of its own for a guest, or for a racer who is logged in."""
    context = browser.new_context(base_url=address, locale="en-GB", **options)
    context.set_default_timeout(30_000)
    if racer is not None:
        client = Client()
        client.force_login(racer, backend=BACKEND)
        context.add_cookies([{"name": "sessionid", "value": client.cookies["sessionid"].value, "url": address}])
    return context


def shoot(page: Page, name: str) -> None:
    """Pictures of a page at both widths and in both themes, in the folder ``PADDOCK_SHOTS``."""
    for width in (360, 1280):
        for theme in ("dark", "light"):
            page.set_viewport_size({"width": width, "height": 900})
            page.emulate_media(color_scheme=theme)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            page.screenshot(path=Path(SHOTS or ".") / f"{name}-{width}-{theme}.png", full_page=True)

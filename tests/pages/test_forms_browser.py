"""Every form of the site is sent once in a real browser, by somebody who may, and what should come of it comes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise

import pytest
from django.test import Client

from tests.pages.browsing import BACKEND, IN_A_BROWSER, chromium, visitor
from tests.pages.conftest import make_world
from tests.pages.form_cases import CASES, Case
from tests.pages.form_world import Cast
from tests.pages.forms import Form, addresses, admin_addresses, button_of, forms_in, name_of, page_of_form, walk

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
WAIT_MS = 30_000
A_LIST = re.compile(r"/admin/\w+/\w+/")
ELSEWHERE = "mfa_"  # what a second factor needs is done in tests/pages/test_second_factor_browser.py
PRESSED = """button => {
  const form = button.form, action = form.elements.namedItem("action");
  return [!!button.closest("header"), form.method, button.getAttribute("formaction") || form.getAttribute("action")
    || location.pathname, button.name, button.value, action && action.tagName === "SELECT" ? action.value : ""];
}"""


@pytest.fixture
def cast(wakes, video_wakes, trainings_taken_on) -> Cast:
    """The world with everybody in it, and no broker."""
    return Cast(make_world())


class Browsing:
    """The windows of the cast, what was sent in them, and error."""

    def __init__(self, browser, address: str, cast: Cast) -> None:
        self.seen: dict[Form, str] = {}
        self.sent: set[Form] = set()
        self.wrong: list[str] = []
        self._browser, self._address, self._cast = browser, address, cast
        self._admin = Client()
        self._admin.force_login(cast.racers["admin"], backend=BACKEND)
        self._pages: dict[tuple[str, bool], object] = {}
        self._doing = ""

    def look(self, viewer: str, address: str, html: str) -> None:
        """Note the forms of a page."""
        for form in forms_in(address, html):
            if form.page.startswith(ELSEWHERE) or form.action.startswith(ELSEWHERE):
                continue
            self.seen.setdefault(form, f"{viewer} at {address}")

    def page(self, viewer: str, scripts: bool = True):
        """The window of a viewer, in which nothing may be forbidden, break or complain."""
        if (viewer, scripts) not in self._pages:
            context = visitor(self._browser, self._address, self._cast.racers[viewer], java_script_enabled=scripts)
            page = context.new_page()
            page.on("response", lambda answer: self._note(answer.status in (400, 403) or answer.status > 499, answer))
            page.on("pageerror", lambda error: self._note(True, error))
            page.on("console", self._console)
            self._pages[viewer, scripts] = page
        return self._pages[viewer, scripts]

    def check(self, address: str, html: str, headers: Mapping[str, str]) -> None:
        """A page asks browsers for nothing that would have its forms refused: no policy of its own about referrers
        (without one a form is sent with ``Origin: null``), and none about what forms may do."""
        own = 'name="referrer"' in html or headers.get("Referrer-Policy") != "same-origin"
        if own or "form-action 'self'" not in headers.get("Content-Security-Policy", ""):
            self.wrong.append(f"{address} has headers of its own: {headers}")

    def search(self, form: Form) -> None:
        """The search above a list of the admin site is one form of Django's; what it looks in is ours."""
        answer = self._admin.get(self.seen[form].partition(" at ")[2], {"q": "a"})
        if answer.status_code != 200:
            self.wrong.append(f"{form}: {answer.status_code}")
        self.sent.add(form)

    def do(self, case: Case) -> None:
        """Send a form and hold what comes of it against what should."""
        self._doing = f"{case.by} at {case.at or 'the same page'}, {case.press}"
        page = self.page(case.by, case.scripts)
        try:
            if case.at:
                page.goto(case.at.format(**self._cast.words), wait_until="domcontentloaded")
            for label, value in case.fill.items():
                _fill(page, label, value.format(**self._cast.words) if isinstance(value, str) else value)
            button = _button(page, case, case.press.format(**self._cast.words))
            button.evaluate("button => { const menu = button.closest('details'); if (menu) menu.open = true; }")
            in_head, method, action, name, value, chosen = button.evaluate(PRESSED)
            form = Form(
                page_of_form(page.url, action, in_head),
                method,
                name_of(action),
                f"action={chosen}" if chosen else button_of(name, value),
            )
            outcome = _outcome(page, case.then.format(**self._cast.words))
            assert not outcome.count(), f"{case.then!r} is there before anything is sent"
            button.click()
            outcome.first.wait_for(state="attached", timeout=WAIT_MS)
            self.sent.add(form)
            self.look(case.by, page.url, page.content())
        except Exception as error:
            told = page.locator(".messages, .fault, .errors, .errornote, .errorlist, h1").all_inner_texts()
            self.wrong.append(f"{self._doing}: {str(error).splitlines()[0]} – the page at {page.url} says {told}")

    def rest(self, case: Case) -> None:
        """A page that nobody looks at draws nothing and listens to nothing."""
        self.page(case.by, case.scripts).goto("about:blank")

    def do_admin(self, form: Form) -> None:
        """Send a form of the admin site as it stands there: what is Django's about it needs no entry of its own."""
        self._doing = str(form)
        try:
            self._send_admin(form)
        except Exception as error:
            self.wrong.append(f"{form} at {self.seen[form]}: {str(error).splitlines()[0]}")

    def _send_admin(self, form: Form) -> None:
        page = self.page("admin")
        page.goto(self.seen[form].partition(" at ")[2], wait_until="domcontentloaded")
        if form.button.startswith("action="):
            page.locator("input.action-select").first.check()
            page.locator("select[name=action]").first.select_option(form.button.removeprefix("action="))
            press, then = "#changelist-form button[name=index]", "body"
        else:
            press = "#content form[method=post] [type=submit]:not([name=_addanother], [name=_continue])"
            then = ".messagelist .success, .errornote" if form.page.endswith("_add") else ".messagelist .success"
        with page.expect_response(lambda answer: answer.request.method == "POST") as answer:
            page.locator(press).first.click()
        page.wait_for_load_state("domcontentloaded")
        if answer.value.status not in (200, 302) or not page.locator(then).count():
            self.wrong.append(
                f"{form}: {answer.value.status}, {page.locator('.errornote, .errorlist').all_inner_texts()}"
            )
        self.sent.add(form)

    def _console(self, line) -> None:
        self._note(line.type == "error" and "status of 4" not in line.text, line.text)

    def _note(self, is_wrong: bool, what: object) -> None:
        if is_wrong:
            self.wrong.append(f"{self._doing}: {what}")


def _button(page, case: Case, press: str):
    """``press``: of the case, with the words of the world in it."""
    if press.startswith("css="):
        return page.locator(case.inside).locator(press).first
    name = re.compile(rf"^{re.escape(press)}(?!\w)")
    return page.locator(case.inside).get_by_role("button", name=name, include_hidden=True).first


def _outcome(page, then: str):
    return page.locator(then) if then.startswith("css=") else page.get_by_text(then)


def _fill(page, label: str, value: object) -> None:
    main = page.locator("main, #content").first
    field = main.locator(label) if label.startswith("css=") else main.get_by_label(label, exact=True)
    kind = field.evaluate(
        "field => { const menu = field.closest('details'); if (menu) menu.open = true; return field.type; }"
    )
    if kind == "file":
        field.set_input_files(value)
    elif kind.startswith("select"):
        field.select_option(value)  # by what it says, or by its value
    elif isinstance(value, bool):
        field.set_checked(value)
    else:
        field.fill(value)


@pytest.mark.parametrize("admin", [False, pytest.param(True, marks=pytest.mark.soak)], ids=["site", "admin site, too"])
def test_every_form_of_the_site_can_be_sent(admin: bool, cast: Cast, live_server) -> None:
    """``admin``: those of the admin site, too, of which otherwise the searches are tried."""
    with chromium(briefly=True) as browser:
        browsing = Browsing(browser, live_server.url, cast)
        for viewer, racer in cast.racers.items():
            client = Client()
            if racer is not None:
                client.force_login(racer, backend=BACKEND)
            pages = [*addresses(cast.examples(viewer))]
            if viewer == "admin":
                pages += [address for address in admin_addresses() if admin or A_LIST.fullmatch(address)]
            for address, html, headers in walk(client, pages):
                browsing.look(viewer, address, html)
                browsing.check(address, html, headers)
        for case, following in pairwise([*CASES, CASES[0]]):
            browsing.do(case)
            if following.by != case.by:
                browsing.rest(case)
        for form in sorted(browsing.seen.keys() - browsing.sent, key=lambda form: (form.page.endswith("delete"), form)):
            if form.page.startswith("admin:") and form.method != "post":
                browsing.search(form)
            elif form.page.startswith("admin:") and admin:
                browsing.do_admin(form)
        left = {form for form in browsing.seen.keys() - browsing.sent if admin or not form.page.startswith("admin:")}
        missing = [f"no case sends {form}, seen by {browsing.seen[form]}" for form in sorted(left)]
    wrong = "\n".join([*browsing.wrong, *missing])
    assert not wrong, wrong

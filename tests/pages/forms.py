"""Every form of the site: which there are on every page of the address list, for everybody, and their names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from html.parser import HTMLParser
from urllib.parse import urlsplit

from django.contrib import admin
from django.test import Client
from django.urls import Resolver404, URLPattern, URLResolver, get_resolver, resolve, reverse

SHELL = "every page"  # where the buttons in the head of the page stand
# the same part of a page, asked for by itself or under another tab
PARTS = {"race_rules": "race", "race_runs": "race", "race_live": "race", "evaluation_live": "evaluation"}
PARTS |= {"video_live": "evaluation", "training_live": "training"}
ANYWHERE = {"training_first", "spoilers"}  # the same button wherever a car, or a hidden result, is asked for
OF_DJANGO = ("_addanother", "_continue")  # twins of Save in the admin site
NO_PAGES = ("api/", "admin/", "i18n/", "health/")  # the admin site is walked by its registry
A_FILE = re.compile(r"\.\w+$|\\\.\(|<str:name>$|/(export|print)/<\w+:form>/$")


@dataclass(frozen=True, order=True)
class Form:
    """A way to send something: the page it stands on, the view it goes to (names of addresses), and its button."""

    page: str
    method: str
    action: str
    button: str = ""

    def __str__(self) -> str:
        return f"{self.page}: {self.method} {self.action}{f' ({self.button})' if self.button else ''}"


def name_of(address: str) -> str:
    """The name of the view behind an address."""
    try:
        found = resolve(urlsplit(address).path)
    except Resolver404:
        return address
    name = found.view_name or found.route
    return PARTS.get(name, name)


def button_of(name: str, value: str) -> str:
    """What a button says to the server, without the row that it says it of, as in ``change:12`` or ``again=3``."""
    said = "" if value.isdigit() else value.partition(":")[0]
    return f"{name}={said}" if name and name != "index" else ""


class _Forms(HTMLParser):
    def __init__(self, address: str, html: str) -> None:
        super().__init__()
        self.found: set[Form] = set()
        self._address, self._head, self._form, self._select = address, 0, None, ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = {name: value or "" for name, value in attrs}
        if tag == "header":
            self._head += 1
        elif tag == "form":
            where = said.get("action") or self._address
            self._form = said.get("method", "get").lower(), where, set(), set()
        elif self._form is None:
            return
        elif tag == "select":
            self._select = said.get("name", "")
        elif tag == "option" and self._select == "action" and self._form[0] == "post" and said.get("value"):
            self._form[3].add(f"action={said['value']}")
        elif (tag == "button" and said.get("type", "submit") == "submit") or (
            tag == "input" and said.get("type") == "submit"
        ):
            where = said.get("formaction") or self._form[1]
            self._form[2].add((where, said.get("name", ""), said.get("value", "")))

    def handle_endtag(self, tag: str) -> None:
        if tag == "header":
            self._head -= 1
        elif tag == "select":
            self._select = ""
        elif tag == "form" and self._form is not None:
            (method, where, buttons, actions), self._form = self._form, None
            page = page_of_form(self._address, where, self._head)
            if not buttons and page.startswith("admin:"):
                return  # a row that is only looked at
            for to, name, value in buttons or {(where, "", "")}:
                if name in OF_DJANGO:
                    continue
                for button in actions or {button_of(name, value)}:
                    self.found.add(Form(page, method, name_of(to), button))


def page_of_form(address: str, action: str, in_head: bool) -> str:
    """The name of the page of a form. A page that follows the question for the password stands at its address."""
    to = name_of(action)
    if in_head or to in ANYWHERE:
        return SHELL
    page = name_of(address)
    return to if page == "account_reauthenticate" else page


def forms_in(address: str, html: str) -> set[Form]:
    """The forms of a page, or of a part of one."""
    return _Forms(urlsplit(address).path, html).found


def addresses(examples: Mapping[str, Iterable[Mapping[str, object]]]) -> Iterator[str]:
    """Every page of the site. ``examples``: for the beginning of a route (a whole one where it ends in $), what its
    parameters may be."""
    for route, name in _routes(get_resolver().url_patterns):
        if route.startswith(NO_PAGES) or A_FILE.search(route):
            continue
        if "<" not in route:
            yield reverse(name)
            continue
        known = max((begin for begin in examples if route.startswith(begin)), key=len, default=None)
        assert known is not None, f"say in EXAMPLES which pages of {route!r} to look at"
        for parameters in examples[known]:
            yield reverse(name, kwargs=dict(parameters))


def admin_addresses() -> Iterator[str]:
    """Of every model in the admin site: the list, the page for a new row and the first row's pages."""
    yield from ("/admin/", "/admin/login/")
    for model in sorted(admin.site._registry, key=lambda model: model._meta.label):
        begin = f"admin:{model._meta.app_label}_{model._meta.model_name}"
        yield reverse(f"{begin}_changelist")
        yield reverse(f"{begin}_add")
        if (row := model._default_manager.order_by("pk").first()) is not None:
            for page in ("change", "delete", "history"):
                yield reverse(f"{begin}_{page}", args=[row.pk])


def walk(client: Client, pages: Iterable[str]) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Address, text and headers of each of the pages that this reader may see."""
    for address in pages:
        response = client.get(address, follow="/accounts/" in address)
        shown = response.status_code == 200 and response.get("Content-Type", "").startswith("text/html")
        if shown and not response.streaming:
            yield response.request["PATH_INFO"], response.content.decode(), dict(response.headers)


def _routes(patterns: Iterable[URLPattern | URLResolver], before: str = "") -> Iterator[tuple[str, str]]:
    for pattern in patterns:
        route = before + str(pattern.pattern)
        if isinstance(pattern, URLResolver):
            yield from _routes(pattern.url_patterns, route)
        elif pattern.name is not None:
            yield route, pattern.name


class _Fields(HTMLParser):
    """The fields of each form of a page that is sent by POST, as they stand there, and the labels of all fields."""

    def __init__(self, address: str, html: str) -> None:
        super().__init__()
        self.forms: list[tuple[str, dict[str, object]]] = []
        self.labels: dict[str, str] = {}
        self._address, self._now, self._ids = address, None, {}
        self._label = self._area = self._select = ""
        self.feed(html)

    def name_of(self, label: str) -> str:
        """The name of the field with a label, or that ``css=[name=...]`` means; empty for another way to name it."""
        if found := re.fullmatch(r"css=\[name=([\w-]+)\]", label):
            return found[1]
        return self._ids.get(self.labels.get(label, ""), "")

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = {name: value or "" for name, value in attrs}
        name, value = said.get("name", ""), said.get("value", "")
        if said.get("id") and name:
            self._ids[said["id"]] = name
        if tag == "label":
            self._label = said.get("for", "")
        elif tag == "form":
            self._now = {} if said.get("method", "").lower() == "post" else None
            if self._now is not None:
                self.forms.append((urlsplit(said.get("action") or self._address).path, self._now))
        elif self._now is None:
            return
        elif tag == "textarea":
            self._area, self._now[name] = name, ""
        elif tag == "select":
            self._select = name
        elif tag == "option" and self._select and ("selected" in said or self._select not in self._now):
            self._now[self._select] = value
        elif tag in ("input", "button") and name:
            kind = said.get("type", "submit" if tag == "button" else "text")
            chosen = kind not in ("checkbox", "radio", "file", "submit", "image") or "checked" in said
            if chosen or (kind == "submit" and "" not in self._now):
                self._now[name] = value or ("on" if kind == "checkbox" else "")
                self._now |= {"": name} if kind == "submit" else {}

    def handle_data(self, data: str) -> None:
        if self._label and data.strip():
            self.labels.setdefault(data.strip().rstrip(":"), self._label)
        elif self._area and self._now is not None:
            self._now[self._area] += data

    def handle_endtag(self, tag: str) -> None:
        if tag == "form":
            self._now = None
        elif tag in ("label", "textarea", "select"):
            setattr(self, {"label": "_label", "textarea": "_area", "select": "_select"}[tag], "")


def filled_form(address: str, html: str, action: str, fill: Mapping[str, object]) -> dict[str, object] | None:
    """What a browser sends from a page by the first form that goes to ``action``, ``fill`` in the fields of these
    labels; None where no form goes there."""
    page = _Fields(urlsplit(address).path, html)
    sent = next((fields for path, fields in page.forms if path == action), None)
    if sent is not None:
        sent.pop("", None)
        sent |= {name: value for label, value in fill.items() if (name := page.name_of(label))}
    return sent

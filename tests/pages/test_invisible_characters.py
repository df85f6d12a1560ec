"""A text with an invisible character, sent in every text field of every form of the site: nothing keeps it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache, reduce
from html.parser import HTMLParser
from operator import or_

import pytest
from django.apps import apps
from django.db import connection, models, transaction
from django.forms import BaseForm
from django.test import Client

from tests.core.test_visible_texts import OURS
from tests.pages.forms import admin_addresses, name_of
from tests.pages.walk import Site, make_site
from tests.soak import only

pytestmark = [pytest.mark.slow, pytest.mark.django_db]
TEXTS = ("text", "search", "")
MARK = "U+202E"  # what is said of the character


class _Inputs(HTMLParser):
    """The forms of a page that send by POST: where to, what they would send as they stand, and their texts."""

    def __init__(self, address: str, html: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, list[str]], list[str]]] = []
        self._address, self._form, self._area, self._select = address, None, "", ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = {name: value or "" for name, value in attrs}
        name, value = said.get("name", ""), said.get("value", "")
        if tag == "form" and said.get("method", "").lower() == "post":
            self._form = said.get("action") or self._address, {}, []
            self.found.append(self._form)
        if self._form is None or (not name and tag != "option"):
            return
        if tag == "textarea":
            self._area = name
            self._form[1].setdefault(name, [""])
            self._form[2].append(name)
        elif tag == "select":
            self._select = name
        elif tag == "option" and self._select and "selected" in said:
            self._form[1].setdefault(self._select, []).append(value)
        elif tag == "button" and name:
            self._form[1].setdefault(name, [value])
        elif tag == "input" and ("checked" in said or said.get("type", "") not in ("checkbox", "radio", "file")):
            self._form[1].setdefault(name, []).append(value)
            if said.get("type", "") in TEXTS:
                self._form[2].append(name)

    def handle_data(self, data: str) -> None:
        if self._form is not None and self._area:
            self._form[1][self._area][0] += data.removeprefix("\n")

    def handle_endtag(self, tag: str) -> None:
        if tag == "form":
            self._form = None
        elif tag == "textarea":
            self._area = ""
        elif tag == "select":
            self._select = ""


@pytest.fixture
def site(wakes, video_wakes, trainings_taken_on) -> Site:
    return make_site()


def _forms(client: Client, path: str) -> list[tuple[str, dict[str, list[str]], list[str]]]:
    answer = client.get(path)
    if answer.status_code != 200 or answer.streaming or "html" not in answer.get("Content-Type", ""):
        return []
    return _Inputs(path, answer.content.decode()).found


def _with_character(values: dict[str, list[str]], texts: Iterable[str]) -> dict[str, list[str]]:
    return values | {name: [(values[name][0] or "Some text") + "\u202e"] for name in texts}


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Names of fields of which a form said that they hold the character; for a test to clear."""
    names: set[str] = set()
    add_error = BaseForm.add_error

    def noting(form: BaseForm, field: str | None, error: object) -> None:
        add_error(form, field, error)
        names.update(form.add_prefix(name) for name, said in form.errors.items() if any(MARK in one for one in said))

    monkeypatch.setattr(BaseForm, "add_error", noting)
    return names


def _kept() -> list[str]:
    """The models of which a row holds the character: one statement asks them all."""
    with connection.cursor() as cursor:
        cursor.execute(*_question())
        return [label for (label,) in cursor.fetchall()]


@cache
def _question() -> tuple[str, list[object]]:
    parts, values = [], []
    for model, condition in _conditions().items():
        found = model._base_manager.filter(condition).values("pk")  # type: ignore[attr-defined]
        sql, given = found.query.sql_with_params()
        parts.append(f"SELECT '{model._meta.label}' WHERE EXISTS ({sql})")
        values += given
    return " UNION ALL ".join(parts), values


@cache
def _conditions() -> dict[type[models.Model], models.Q]:
    return {
        model: reduce(or_, [models.Q(**{f"{name}__contains": "\u202e"}) for name in names])
        for model in apps.get_models()
        if model._meta.app_label in OURS and (names := _texts(model))
    }


def _texts(model: type[models.Model]) -> list[str]:
    texts = (field for field in model._meta.local_fields if isinstance(field, models.CharField | models.TextField))
    return [field.name for field in texts if field.name != "reward_code"]


@pytest.mark.parametrize("end", only(["/add/"], ["/add/", ""]), ids=["new rows", "all of the admin site"])
def test_no_form_of_the_site_keeps_an_invisible_character(end: str, site: Site, refused: set[str]) -> None:
    """All texts of a form are sent with it at once, then each that was not refused by name alone. ``end``: of the
    addresses of the admin site, where a new row has the texts of an old one."""
    clients = {viewer: site.world.client(viewer) for viewer in site.paths}
    pages = [*site.pages(), *(("admin", path) for path in admin_addresses() if path.endswith(end))]
    done: set[tuple[str, str, str]] = set()
    named, wrong = 0, []
    for viewer, path in pages:
        if "logout" in path:
            continue
        for action, values, texts in _forms(clients[viewer], path):
            left = [name for name in texts if (viewer, name_of(action), name) not in done]
            done |= {(viewer, name_of(action), name) for name in left}
            sendings = [left] if left else []
            while sendings:
                names = sendings.pop()
                refused.clear()
                with transaction.atomic():
                    clients[viewer].raise_request_exception = False
                    answer = clients[viewer].post(action, _with_character(values, names))
                    named += max(len(refused & {*names}), MARK in answer.content.decode(errors="replace"))
                    if answer.status_code >= 500:
                        wrong.append(f"{viewer} at {path}, {names}: {answer.status_code}")
                    elif answer.status_code < 400:
                        wrong += [f"{viewer} at {path}, {names}: {kept}" for kept in _kept()]
                    transaction.set_rollback(True)
                if len(names) > 1:
                    sendings += [[name] for name in names if name not in refused]
    assert wrong == []
    assert len(done) > 60 and named > 20, (len(done), named)

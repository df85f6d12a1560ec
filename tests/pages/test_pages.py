"""Every page for everybody: the right status, in both languages, with nothing that the content policy would block."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from itertools import cycle

import pytest
from django.utils import translation
from django.utils.formats import date_format, localize

from core.templatetags import formats
from tests.pages.conftest import VIEWERS, World

ALL = dict.fromkeys(VIEWERS, 200)
LOGIN = {**ALL, "anonymous": 302}
ORGANISERS = {"anonymous": 302, "newcomer": 404, "alice": 200, "bob": 404, "admin": 200}
INSIDERS = {"anonymous": 404, "newcomer": 404, "alice": 200, "bob": 404, "admin": 200}
ALICE = {"anonymous": 302, "newcomer": 404, "alice": 200, "bob": 404, "admin": 404}

PAGES = {
    "/": ALL,
    "/about/": ALL,
    "/races/": ALL,
    "/races/?show=upcoming": ALL,
    "/races/?show=closed&kind=community": ALL,
    "/races/?show=cancelled": ALL,
    "/races/?show=mine": LOGIN,
    "/races/?show=nonsense&kind=nonsense&page=nonsense": ALL,
    "/races/open-race/": ALL,
    "/races/open-race/?page=99": ALL,
    "/races/open-race/?page=nonsense": ALL,
    "/races/open-race/rules/": ALL,
    "/races/open-race/runs/": LOGIN,
    "/races/waiting-race/": ALL,
    "/races/fault-race/": ALL,
    "/races/fault-race/rules/": ALL,
    "/races/next-race/": ALL,
    "/races/old-race/": ALL,
    "/races/no-race/": ALL,
    "/races/secret-race/": INSIDERS,
    "/races/secret-race/rules/": INSIDERS,
    "/races/secret-race/board.csv": INSIDERS,
    "/races/secret-race/board.json": INSIDERS,
    "/races/nothing-here/": dict.fromkeys(VIEWERS, 404),
    "/races/new/": LOGIN,
    "/races/open-race/edit/": ORGANISERS,
    "/races/open-race/racers/": ORGANISERS,
    "/races/open-race/cancel/": ORGANISERS,
    "/races/open-race/close/": ORGANISERS,
    "/races/open-race/racers/bob/remove/": ORGANISERS,
    "/races/open-race/racers/nobody/remove/": {**dict.fromkeys(VIEWERS, 404), "anonymous": 302},
    "/races/open-race/withdraw/": {**ORGANISERS, "bob": 200, "admin": 404},
    "/races/secret-race/edit/": ORGANISERS,
    "/races/join/{invitation}/": ALL,
    "/races/join/of-no-race/": dict.fromkeys(VIEWERS, 404),
    "/evaluations/{finished}/": ALL,
    "/evaluations/{finished}/?colour=lap&lap=2": ALL,
    "/evaluations/{finished}/?colour=nonsense&lap=99": ALL,
    "/evaluations/{finished}/replay.json": ALL,
    "/evaluations/{finished}/trace.csv": ALL,
    "/evaluations/{finished}/metrics.json": ALL,
    "/evaluations/{other}/": INSIDERS,
    "/evaluations/{other}/trace.csv": INSIDERS,
    "/evaluations/{other}/replay.json": INSIDERS,
    "/evaluations/{queued}/": INSIDERS,
    "/evaluations/{queued}/live/": INSIDERS,
    "/evaluations/{queued}/trace.csv": dict.fromkeys(VIEWERS, 404),
    "/evaluations/{running}/": {**INSIDERS, "alice": 404, "bob": 200},
    "/evaluations/{failed}/": INSIDERS,
    "/evaluations/{failed}/metrics.json": dict.fromkeys(VIEWERS, 404),
    "/evaluations/{ours}/": {**INSIDERS, "alice": 404, "bob": 200},
    "/evaluations/nothing/": dict.fromkeys(VIEWERS, 404),
    "/models/": LOGIN,
    "/models/upload/": LOGIN,
    "/models/{model}/": ALICE,
    "/models/{model}/edit/": ALICE,
    "/models/{model}/delete/": ALICE,
    "/tracks/": ALL,
    "/tracks/oval/": ALL,
    "/tracks/nothing/": dict.fromkeys(VIEWERS, 404),
    "/tracks/import/": LOGIN,
    "/seasons/": ALL,
    "/seasons/nothing/": dict.fromkeys(VIEWERS, 404),
    "/seasons/new/": {**dict.fromkeys(VIEWERS, 403), "anonymous": 302, "admin": 200},
    "/workers/": {**dict.fromkeys(VIEWERS, 403), "anonymous": 302, "admin": 200},
    "/workers/evaluations/failed/": {**dict.fromkeys(VIEWERS, 403), "anonymous": 302, "admin": 200},
    "/workers/none/failed/": {**dict.fromkeys(VIEWERS, 403), "anonymous": 302, "admin": 404},
    "/hall-of-fame/": ALL,
    "/races/open-race/board.atom": ALL,
    "/races/open-race/badge.svg": ALL,
    "/races/open-race/badge.svg?racer=alice": ALL,
    "/races/secret-race/board.atom": INSIDERS,
    "/races/secret-race/badge.svg": INSIDERS,
    "/notices/": LOGIN,
    "/settings/notices/": LOGIN,
    "/settings/webhooks/": LOGIN,
    "/racers/alice/": ALL,
    "/racers/house-steady/": ALL,
    "/racers/nobody/": dict.fromkeys(VIEWERS, 404),
    "/settings/": LOGIN,
    "/settings/tokens/": LOGIN,
    "/settings/usage/": LOGIN,
    "/settings/alias/": LOGIN,
    "/settings/data/": LOGIN,
    "/settings/data/delete/": LOGIN,
    "/usage/": {**dict.fromkeys(VIEWERS, 403), "anonymous": 302, "admin": 200},
    "/join/of-no-invitation/": dict.fromkeys(VIEWERS, 302),
    "/accounts/email/": LOGIN,
    "/accounts/login/": {**dict.fromkeys(VIEWERS, 302), "anonymous": 200},
    "/accounts/signup/": {**dict.fromkeys(VIEWERS, 302), "anonymous": 200},
    "/accounts/password/reset/": ALL,
    "/accounts/password/reset/done/": ALL,
    "/nothing/at/all/": dict.fromkeys(VIEWERS, 404),
}
INLINE = re.compile(
    r"""<style|\sstyle=|\son[a-z]+=|javascript:|<script(?![^>]*\ssrc=)(?![^>]*application/json)""", re.I
)


def address(world: World, path: str) -> str:
    """The path with the ids of this world."""
    names = ("finished", "other", "queued", "running", "failed", "ours")
    ids = {name: getattr(world, name).evaluation.public_id for name in names}
    return path.format(**ids, model=world.model.public_id, invitation=world.secret.invitation)


@pytest.mark.slow
@pytest.mark.parametrize(
    "languages", [("en", "ko"), *(pytest.param((each,), marks=pytest.mark.soak) for each in ("en", "ko"))], ids="+".join
)
def test_every_page_has_the_right_status_for_everybody(world: World, languages: tuple[str, ...]) -> None:
    """In two languages in turn: each page in both, to one viewer or the next."""
    wrong, blocked, turn = [], [], cycle(languages)
    for viewer in VIEWERS:
        client = world.client(viewer)
        if not len(PAGES) % len(languages):
            next(turn)  # or each viewer would have a page in the same language
        for path, expected in PAGES.items():
            client.cookies["django_language"] = language = next(turn)
            response = client.get(address(world, path))
            if response.status_code != expected[viewer]:
                wrong.append((viewer, path, response.status_code, expected[viewer]))
            if response.streaming or not response["Content-Type"].startswith("text/html") or not response.content:
                continue
            html = response.content.decode()
            if found := INLINE.search(html):
                blocked.append((viewer, path, html[found.start() : found.start() + 60]))
            if "<html" in html:
                assert f'<html lang="{language}"' in html, (viewer, path)
    assert not wrong
    assert not blocked


def test_a_page_loads_only_files_of_this_site_and_says_so(world: World) -> None:
    response = world.client("alice").get(f"/evaluations/{world.finished.evaluation.public_id}/")
    policy = response["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self'" in policy and "unsafe" not in policy
    loaded = re.findall(r'(?:src|href)="(https?:)?//', response.content.decode())
    assert not loaded


def test_pages_that_write_nothing_answer_only_get(world: World) -> None:
    client = world.client("alice")
    for path in ("/", "/about/", "/races/", "/races/open-race/", "/tracks/", "/racers/alice/", "/models/"):
        assert client.post(path).status_code == 405, path


def test_a_get_request_writes_nothing(world: World) -> None:
    client = world.client("bob")
    for path in (
        "/races/open-race/enter/",
        "/races/open-race/submit/",
        "/races/secret-race/invitation/reset/",
        f"/evaluations/{world.running.evaluation.public_id}/stop/",
        "/theme/",
        "/settings/tokens/x/revoke/",
    ):
        assert client.get(path).status_code == 405, path


def test_every_write_needs_the_csrf_token(world: World) -> None:
    from django.test import Client

    client = Client(enforce_csrf_checks=True)
    client.force_login(world.alice, backend="django.contrib.auth.backends.ModelBackend")
    for path in (
        "/races/open-race/enter/",
        "/races/open-race/submit/",
        "/races/open-race/withdraw/",
        "/races/new/",
        "/races/open-race/edit/",
        "/races/open-race/cancel/",
        "/races/open-race/close/",
        "/races/secret-race/invitation/reset/",
        "/races/open-race/racers/bob/remove/",
        f"/races/join/{world.secret.invitation}/",
        f"/evaluations/{world.queued.evaluation.public_id}/stop/",
        "/models/upload/",
        f"/models/{world.model.public_id}/edit/",
        f"/models/{world.model.public_id}/delete/",
        "/tracks/import/",
        "/settings/",
        "/settings/tokens/",
        "/accounts/logout/",
    ):
        response = client.post(path)
        assert response.status_code == 403, path
        assert "This form is out of date" in response.content.decode(), path


def test_a_racers_address_in_another_case_redirects(world: World) -> None:
    response = world.client("anonymous").get("/racers/ALICE/")
    assert response.status_code == 301
    assert response["Location"] == "/racers/alice/"


def test_a_deactivated_racer_is_not_shown(world: World) -> None:
    world.bob.is_active = False
    world.bob.save()
    assert world.client("alice").get("/racers/bob/").status_code == 404


@pytest.mark.parametrize(
    ("language", "day", "shown"),
    [("en", "9 Mar 2026", "Mon 9 Mar 2026, 08:05 UTC"), ("ko", "2026년 3월 9일", "2026년 3월 9일 (월) 08:05 UTC")],
)
def test_pages_and_admin_write_dates_in_one_style(language: str, day: str, shown: str, monkeypatch) -> None:
    moment = datetime(2026, 3, 9, 8, 5, tzinfo=UTC)
    monkeypatch.setattr("django.utils.timezone.now", lambda: datetime(2027, 1, 1, tzinfo=UTC))
    with translation.override(language):
        assert date_format(moment, "DATETIME_FORMAT").startswith(day)
        assert date_format(moment, "DATE_FORMAT") == localize(moment.date()) == day
        assert f">{shown}<" in formats.moment(moment)

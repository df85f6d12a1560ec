"""After an account is deleted no page, feed, file or operation of the site shows its name."""

from __future__ import annotations

import re

import pytest
from django.test import Client

from accounts.leaving.services import delete_account
from accounts.models import Racer
from tests.accounts.leavers import tables_with
from tests.clients import logged_in
from tests.drawn_runs import a_drawing
from tests.pages.walk import make_site
from tests.soak import only
from videos import drawing

NAME = re.compile(r"(?<![A-Za-z0-9-])bob(?![A-Za-z0-9])", re.IGNORECASE)
FILES = ("board.csv", "board.json", "feed.atom", "badge.svg", "results.csv")
OPERATIONS = ("board/", "", "entries/", "duels/", "results/")


@pytest.mark.slow
@pytest.mark.parametrize("before", only(["anonymous"], ["anonymous", "anonymous, alice, admin"]))
def test_no_page_or_operation_shows_the_name_of_a_deleted_account(before, db, wakes, monkeypatch):
    """``before``: who has read all pages while it was there, so that what the process keeps has the name."""
    monkeypatch.setattr(drawing, "write_video", a_drawing)
    monkeypatch.setattr(drawing, "poster", lambda scene: b"a still")
    site = make_site()
    world = site.world
    bob = Racer.objects.get(alias="bob")
    clients = {"anonymous": Client(), "admin": logged_in(world.admin), "alice": logged_in(world.alice)}
    races = ("open-race", "show-race", "video-race", "waiting-race")
    pages = [(viewer, path) for viewer, path in site.pages() if viewer in clients]
    pages += [(viewer, f"/races/{race}/{file}") for viewer in clients for race in races for file in FILES]
    pages += [(viewer, f"/api/v1/races/{race}/{rest}") for viewer in clients for race in races for rest in OPERATIONS]
    pages += [("anonymous", f"/api/v1/seasons/{site.season.slug}/standings/"), ("alice", "/api/v1/notices/")]
    read = [(viewer, path) for viewer, path in pages if viewer in before]
    assert {path for viewer, path in read if NAME.search(body_of(clients[viewer], path))} > {"/races/open-race/"}
    delete_account(racer=bob, by=bob, now=world.now)
    shown = [f"{viewer} {path}" for viewer, path in pages if NAME.search(body_of(clients[viewer], path))]
    assert shown == []
    assert tables_with("bob", "bob@example.org") == []


def body_of(client: Client, path: str) -> str:
    """What the address answers, whatever the status; the address itself does not count."""
    answer = client.get(path)
    content = b"".join(answer.streaming_content) if answer.streaming else answer.content
    return content.decode(errors="replace").replace(path, "")

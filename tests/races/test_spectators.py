"""Spectators' links: what they open, what they do not, and what a renewed link closes."""

from __future__ import annotations

import logging
from datetime import timedelta

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from config.serving.streams.viewers import allowed, name_of, viewers_of
from core.logs.lines import LogLines
from races.entries.services.entries import accept_invitation
from races.live.services import launch
from races.models import LiveRacer, Visibility
from races.pages.services import renew_spectator_link
from races.web.spectator_links import COOKIE, HEADER, spectator_token
from tests.clients import logged_in
from tests.factories import a_racer
from tests.live_shows import a_live_race, a_show, begun, compute, slot_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def event(alice, now):
    race = a_live_race(now, alice, visibility=Visibility.INVITATION)
    for name in ("bob", "carl"):
        accept_invitation(token=race.invitation, racer=a_racer(name), now=now)
    event = begun(a_show(now, alice, ["bob", "carl"], race=race, order="as_entered"), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    launch(event=event, by=alice, seen=None, now=now - timedelta(seconds=13))
    return event


def watching(event, client=None):
    client = client or Client()
    answer = client.get(reverse("live_watch", args=[spectator_token(event.race)]))
    assert answer.status_code == 302, answer.status_code
    return client


def opened(event):
    slug, slot = event.race.slug, slot_of(event, "bob").pk
    return [
        reverse("live_event", args=[slug]),
        reverse("live_state", args=[slug]),
        f"{reverse('live_poses', args=[slug])}?slot={slot}",
        reverse("live_screen", args=[slug]),
        reverse("live_phone", args=[slug]),
        *(reverse("live_overlay", args=[slug, piece]) for piece in ("tower", "clock", "lower-third", "next")),
        f"/api/v1/races/{slug}/live/",
        f"/api/v1/races/{slug}/live/poses/?slot={slot}",
    ]


def test_the_link_opens_the_live_event_and_its_screens(event):
    guest = watching(event)
    for address in opened(event):
        assert Client().get(address).status_code == 404, address
        assert guest.get(address).status_code == 200, address


def test_nothing_else_of_the_race_opens(event):
    guest, race = watching(event), event.race
    for name in ("race", "race_rules", "race_runs", "race_duels", "live_commentary", "live_again", "live_highlights"):
        assert guest.get(reverse(name, args=[race.slug])).status_code in (302, 404), name
    for name in ("board_csv", "board_json", "live_results_csv", "race_results_pdf", "board_atom"):
        assert guest.get(reverse(name, args=[race.slug])).status_code == 404, name
    for path in ("", "board/", "live/figures/", "live/highlights/", "live/results.csv"):
        assert guest.get(f"/api/v1/races/{race.slug}/{path}").status_code == 404, path
    for name in ("live_console", "live_plan", "race_edit"):
        assert guest.get(reverse(name, args=[race.slug])).status_code in (302, 404), name
    assert race.slug not in guest.get(reverse("races")).content.decode()


def test_a_spectator_does_nothing_but_watch(event):
    slug = event.race.slug
    for client in (watching(event), watching(event, logged_in(a_racer("mallory")))):
        assert client.post(reverse("live_react", args=[slug]), {"kind": "clap"}).status_code == 404
        for name in ("live_mine", "live_act", "enter", "race_spectators_renew"):
            assert client.post(reverse(name, args=[slug]), {"here": "1", "action": "pause"}).status_code in (302, 404)
        for path, sent in (("mine/", {"here": True}), ("console/", {"action": "pause", "version": 1})):
            answer = client.post(f"/api/v1/races/{slug}/live/{path}", sent, "application/json")
            assert answer.status_code in (401, 403, 404), path
    event.race.refresh_from_db()
    assert (event.race.spectator_edition, event.race.entries.count()) == (0, 2)
    assert "data-reactions" not in watching(event).get(reverse("live_phone", args=[slug])).content.decode()


def test_spectators_are_in_no_list(event):
    mallory = a_racer("mallory")
    told = watching(event, logged_in(mallory)).get(reverse("live_state", args=[event.race.slug])).json()
    assert "mallory" not in str(told)
    assert not event.race.entries.filter(racer=mallory).exists()
    assert not LiveRacer.objects.filter(event=event, entry__racer=mallory).exists()


def test_a_spectator_of_one_race_sees_no_other(event, alice, now):
    other = a_show(now, alice, [], race=a_live_race(now, alice, visibility=Visibility.INVITATION, name="Other"))
    guest = watching(event)
    assert guest.get(reverse("live_event", args=[other.race.slug])).status_code == 404
    watching(other, guest)
    for one in (event, other):
        assert guest.get(reverse("live_event", args=[one.race.slug])).status_code == 200


def test_a_renewed_link_closes_the_old_one(event, now):
    guest, old = watching(event), spectator_token(event.race)
    renew_spectator_link(race=event.race, now=now)
    for address in opened(event):
        assert guest.get(address).status_code == 404, address
        assert Client().get(address, headers={HEADER: old}).status_code == 404
    assert Client().get(reverse("live_watch", args=[old])).status_code == 404
    assert watching(event).get(opened(event)[0]).status_code == 200


def test_a_renewed_link_ends_open_streams(event, now):
    topics = {f"live:{event.race_id}", f"sees:{event.race_id}"}
    browser = name_of("", [spectator_token(event.race)])
    assert allowed(topics, {browser: topics}) == (set(), {browser: topics}, set())
    renew_spectator_link(race=event.race, now=now)
    assert allowed(topics, {browser: topics}) == (set(), {}, {browser})


def test_a_spectator_follows_no_run_and_no_other_race(event, alice, now):
    other = a_live_race(now, alice, visibility=Visibility.INVITATION, name="Other")
    viewer = viewers_of([name_of("", [spectator_token(event.race)])]).popitem()[1]
    topics = {f"live:{other.pk}", f"race:{other.pk}", f"run:{slot_of(event, 'bob').evaluation.public_id}"}
    browser = name_of("", viewer.spectator_tokens)
    assert allowed(topics, {browser: topics})[1] == {browser: set()}


@pytest.mark.parametrize("forged", ["1-", "x", "1-" + "A" * 27, "999999-" + "A" * 27, "1-" + "A" * 60, "0"])
def test_a_forged_token_opens_nothing(event, forged):
    assert Client().get(f"/watch/{forged}/").status_code == 404
    client = Client()
    client.cookies[COOKIE] = forged
    assert client.get(reverse("live_event", args=[event.race.slug])).status_code == 404
    assert viewers_of([f"|{forged}"]) == {}


def test_the_token_is_in_no_address_that_a_page_has(event):
    token = spectator_token(event.race)
    for part in ("", "event/", "screen/", "overlay/tower/"):
        answer = Client().get(f"/watch/{token}/{part}?theme=light")
        assert answer.status_code == 302
        assert token not in answer.url and answer.url.endswith("?theme=light")
        assert answer["Referrer-Policy"] == "no-referrer"
        assert answer["Cache-Control"] == "private, no-store"
        assert answer.cookies[COOKIE]["httponly"]


def test_answers_to_spectators_are_kept_by_no_shared_cache(event):
    guest = watching(event)
    for address in opened(event):
        for client, headers in ((guest, {}), (Client(), {HEADER: spectator_token(event.race)})):
            answer = client.get(address, headers=headers)
            assert answer.status_code == 200, address
            assert "public" not in answer.get("Cache-Control", ""), address


@pytest.mark.parametrize(
    ("path", "written"),
    [
        ("/watch/1-aaaa_bbbb/screen/", "/watch/…/screen/"),
        ("/races/join/abcDEF/", "/races/join/…/"),
        ("/api/v1/invitations/abcDEF/", "/api/v1/invitations/…/"),
        ("/races/open-race/laps/abc/correct/", "/races/open-race/laps/abc/correct/"),
    ],
)
def test_the_log_has_no_token(path, written):
    record = logging.LogRecord("django.request", 30, "", 0, "Not Found: %s", (path,), None)
    assert LogLines().format(record).endswith(f"Not Found: {written}")


def test_the_qr_code_of_a_race_by_invitation_is_the_spectators_link(event, alice, monkeypatch):
    drawn = []
    monkeypatch.setattr("races.live.views.screens.qr_code", lambda address: drawn.append(address) or "")
    logged_in(alice).get(reverse("live_screen", args=[event.race.slug]))
    watching(event).get(reverse("live_screen", args=[event.race.slug]))
    assert drawn == [f"http://testserver/watch/{spectator_token(event.race)}/"] * 2


def test_a_public_race_needs_no_link(alice, now):
    event = a_show(now, alice, [])
    assert Client().get(reverse("live_watch", args=[spectator_token(event.race)])).status_code == 404
    assert Client().get(reverse("live_phone", args=[event.race.slug])).status_code == 200


def test_an_organiser_reads_and_renews_the_link(event, alice):
    client, slug = logged_in(alice), event.race.slug
    token = spectator_token(event.race)
    assert token in client.get(reverse("race_edit", args=[slug])).content.decode()
    assert client.get(f"/api/v1/races/{slug}/").json()["spectators"] == token
    client.post(reverse("race_spectators_renew", args=[slug]))
    event.race.refresh_from_db()
    renewed = client.post(f"/api/v1/races/{slug}/spectators/", {}, "application/json").json()["spectators"]
    assert len({token, spectator_token(event.race), renewed}) == 3
    bob = event.race.entries.get(racer__alias="bob").racer
    assert logged_in(bob).get(f"/api/v1/races/{slug}/").json()["spectators"] is None
    assert logged_in(bob).post(f"/api/v1/races/{slug}/spectators/", {}, "application/json").status_code == 403

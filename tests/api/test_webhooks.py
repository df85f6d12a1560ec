"""Webhooks through the API, and whose they are."""

from __future__ import annotations

from datetime import timedelta

import pytest

from league.models import Webhook, WebhookDelivery
from league.webhooks.services import PER_RACER, add_webhook
from tests.factories import a_race
from tests.wakeups import heard

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/webhooks/"


@pytest.fixture
def hook(alice) -> Webhook:
    return add_webhook(owner=alice, url="https://example.org/hook")


def test_a_webhook_is_added_tested_rekeyed_and_removed(alice, as_racer, now, monkeypatch):
    heard(monkeypatch, "league.tasks.webhooks")
    client, race = as_racer(alice), a_race(now, organiser=alice)
    sent = {"url": "https://example.org/x", "race": race.slug, "events": ["race.closed", "run.finished"]}
    made = client.post(ADDRESS, sent)
    assert made.status_code == 201, made.data
    assert (made.data["race"], made.data["events"], made.data["chat"]) == (
        race.slug,
        ["run.finished", "race.closed"],
        None,
    )
    one = f"{ADDRESS}{made.data['id']}/"
    assert client.get(one).data == client.get(ADDRESS).data["results"][0] == made.data
    queued = client.post(f"{one}test/")
    assert (queued.status_code, queued.data["state"]) == (202, "due")
    (delivery,) = client.get(f"{one}deliveries/").data["results"]
    assert delivery["id"] == queued.data["id"] == f"msg_{WebhookDelivery.objects.get().pk}"
    changed = client.post(f"{one}secret/").data
    assert changed["secret"].startswith("whsec_") and changed["secret"] != made.data["secret"]
    assert changed["old_secret_until"]
    assert client.delete(one).status_code == 204 and not Webhook.objects.exists()


@pytest.mark.parametrize(
    ("changes", "status", "code"),
    [
        ({"url": "ftp://example.org/"}, 400, "webhook_address"),
        ({"url": "https://user:word@example.org/"}, 400, "webhook_address"),
        ({"events": ["rain.began"]}, 400, "invalid"),
        ({"race": "nowhere"}, 404, "not_found"),
        ({"secret": "mine"}, 400, "invalid"),
    ],
)
def test_an_invalid_webhook_is_refused(alice, as_racer, changes, status, code):
    answer = as_racer(alice).post(ADDRESS, {"url": "https://example.org/"} | changes)
    assert (answer.status_code, answer.data["code"]) == (status, code)
    assert not Webhook.objects.exists()


def test_a_racer_has_at_most_ten_webhooks(alice, as_racer):
    client = as_racer(alice)
    for number in range(PER_RACER):
        made = client.post(ADDRESS, {"url": f"https://discord.com/api/webhooks/{number}/x"})
        assert made.data["chat"] == "Discord"
    answer = client.post(ADDRESS, {"url": "https://example.org/"})
    assert (answer.status_code, answer.data["code"]) == (409, "webhook_limit")


def test_only_its_owner_may_use_a_webhook(cast, hook, now):
    WebhookDelivery.objects.create(
        webhook=hook, event="race.opened", about="x", at=now, not_before=now + timedelta(1), body=""
    )
    one = f"{ADDRESS}{hook.pk}/"
    for role in ("member", "stranger", "admin", "anonymous"):
        client, expected = cast[role], 401 if role == "anonymous" else 404
        assert client.get(one).status_code == client.delete(one).status_code == expected, role
        for part in ("secret/", "test/"):
            assert client.post(f"{one}{part}").status_code == expected, role
        assert client.get(f"{one}deliveries/").status_code == expected, role
        assert role == "anonymous" or client.get(ADDRESS).data["results"] == [], role
    assert Webhook.objects.get().secret == hook.secret and WebhookDelivery.objects.count() == 1

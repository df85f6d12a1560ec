"""Webhooks: signed, once, tried again for a while, and never to a private address."""

from __future__ import annotations

import json
from datetime import timedelta

import pytest
from django.core.cache import cache
from django.db import IntegrityError, transaction
from django.test import Client
from django.utils import timezone

from core.wakeups import workers as wakeup
from league.models import Stage, Webhook, WebhookDelivery
from league.stewarding.official_results import close_round
from league.webhooks.deliveries import TRIES, deliver_due, signature
from league.webhooks.payloads import EVENTS
from league.webhooks.services import PER_RACER, TESTS_AN_HOUR, add_webhook, send_test
from paddock.errors import UserFault
from tests.factories import a_race, a_racer, drive, laps
from tests.happened import queue_deliveries
from tests.league.seasons import HOUR, a_round, a_season, after
from tests.wakeups import heard

pytestmark = pytest.mark.django_db


class TestDeliveries:
    def test_opening_result_and_close_are_sent_once_and_signed(self, hook, alice, bob, now, listener):
        race = a_race(now, organiser=alice, opens_at=now - HOUR, closes_at=now + HOUR)
        drive(race, bob, laps(9_000, 9_000, 9_000), now)
        assert queue_deliveries(now=now) == 2 and queue_deliveries(now=now) == 0
        assert queue_deliveries(now=now + 2 * HOUR) == 1
        assert deliver_due(now=now + 2 * HOUR) == 3 and deliver_due(now=now + 2 * HOUR) == 0
        events = {}
        for headers, body in listener.heard:
            assert headers["X-Paddock-Signature"] == signature(hook.secret, body)
            events[headers["X-Paddock-Event"]] = json.loads(body)
            assert json.loads(body)["type"] == json.loads(body)["event"] == headers["X-Paddock-Event"]
        assert set(events) == {"race.opened", "race.result", "race.closed"}
        assert events["race.result"]["data"]["racer"] == "bob" and events["race.result"]["data"]["score_ms"] == 9_000
        assert events["race.opened"]["race"]["slug"] == race.slug
        assert set(WebhookDelivery.objects.values_list("state", "status")) == {("sent", 204)}

    def test_races_of_others_send_nothing(self, hook, bob, now):
        a_race(now, organiser=bob, opens_at=now - HOUR)
        a_round(a_season(), 1, Stage.OPEN)
        assert queue_deliveries(now=now) == 0

    def test_a_webhook_of_one_race_is_told_of_no_other(self, hook, alice, bob, now):
        race = a_race(now, organiser=alice, opens_at=now - HOUR)
        other = a_race(now, organiser=alice, opens_at=now - HOUR)
        Webhook.objects.update(race=other)
        queue_deliveries(now=now)
        assert json.loads(WebhookDelivery.objects.get().body)["race"]["slug"] == other.slug != race.slug
        type(race).objects.update(organiser=bob)
        assert queue_deliveries(now=other.closes_at) == 0

    def test_admins_are_told_of_the_league_and_official_results(self, now, listener):
        admin = a_racer(is_staff=True)
        round_ = a_round(a_season(), 1, Stage.OPEN)
        add_webhook(owner=admin, url="https://example.org/")
        Webhook.objects.update(created_at=round_.race.opens_at - HOUR)
        close_round(round=round_, now=after(round_))
        queue_deliveries(now=after(round_))
        assert set(WebhookDelivery.objects.values_list("event", flat=True)) == {"race.closed", "race.official"}

    def test_nothing_older_than_the_webhook_is_sent(self, hook, alice, now):
        Webhook.objects.update(created_at=now)
        a_race(now, organiser=alice, opens_at=now - HOUR)
        assert queue_deliveries(now=now) == 0

    @pytest.mark.parametrize("status", [302, 404, 500])
    def test_a_failed_delivery_is_retried_then_given_up(self, hook, alice, now, listener, status):
        listener.status = status
        a_race(now, organiser=alice, opens_at=now - HOUR)
        queue_deliveries(now=now)
        moment, pauses = now, []
        while (delivery := WebhookDelivery.objects.get()).state == "due":
            pauses.append((delivery.not_before - moment) // timedelta(minutes=1))
            moment = delivery.not_before
            assert deliver_due(now=moment - timedelta(seconds=1)) == 0
            assert deliver_due(now=moment) == 1
        assert pauses == [0, 1, 4, 16, 64, 256] and delivery.state == "failed" and delivery.status == status
        assert len(listener.heard) == TRIES, "a redirect is not followed"

    def test_nothing_is_sent_to_a_private_address_unless_allowed(self, hook, alice, now, listener, settings):
        settings.WEBHOOKS_PRIVATE = False
        a_race(now, organiser=alice, opens_at=now - HOUR)
        queue_deliveries(now=now)
        deliver_due(now=now)
        delivery = WebhookDelivery.objects.get()
        assert not listener.heard and delivery.state == "due" and delivery.error == "webhook_private"

    def test_the_database_stores_each_delivery_once(self, hook, now):
        same = {"webhook": hook, "event": "race.opened", "about": "x", "at": now, "not_before": now, "body": ""}
        WebhookDelivery.objects.create(**same)
        with pytest.raises(IntegrityError), transaction.atomic():
            WebhookDelivery.objects.create(**same)


class TestSendingATest:
    """A delivery that the owner asks for."""

    @pytest.fixture(autouse=True)
    def counted_from_nothing(self):
        cache.clear()

    def test_it_is_sent_with_the_next_deliveries_and_signed(self, hook, now, listener):
        delivery = send_test(webhook=hook, now=now)
        assert not listener.heard, "asking sends nothing by itself"
        assert deliver_due(now=now) == 1 and deliver_due(now=now + HOUR) == 0
        ((headers, body),) = listener.heard
        assert headers["X-Paddock-Event"] == "webhook.test" == json.loads(body)["event"]
        assert headers["X-Paddock-Signature"] == signature(hook.secret, body)
        assert json.loads(body)["race"] is None
        delivery.refresh_from_db()
        assert (delivery.state, delivery.status) == ("sent", 204)

    def test_it_is_tried_once_and_its_answer_is_stored(self, hook, now, listener):
        listener.status = 500
        delivery = send_test(webhook=hook, now=now)
        deliver_due(now=now)
        assert deliver_due(now=now + timedelta(days=1)) == 0 and len(listener.heard) == 1
        delivery.refresh_from_db()
        assert (delivery.state, delivery.status, delivery.attempt) == ("failed", 500, 1)

    def test_it_is_not_sent_to_a_private_address(self, hook, now, listener, settings):
        settings.WEBHOOKS_PRIVATE = False
        delivery = send_test(webhook=hook, now=now)
        deliver_due(now=now)
        delivery.refresh_from_db()
        assert (delivery.state, delivery.error) == ("failed", "webhook_private") and not listener.heard

    def test_the_wake_up_is_sent_after_the_commit(self, hook, now, monkeypatch, django_capture_on_commit_callbacks):
        wakes = heard(monkeypatch, "league.tasks.webhooks")
        with django_capture_on_commit_callbacks(execute=True):
            send_test(webhook=hook, now=now)
            assert not wakes
        assert len(wakes) == 1

    def test_without_a_broker_the_periodic_task_sends_it(
        self, hook, now, monkeypatch, listener, django_capture_on_commit_callbacks
    ):
        def away(task, **options):
            raise ConnectionError("no broker")

        monkeypatch.setattr(wakeup, "publish", away)
        with django_capture_on_commit_callbacks(execute=True):
            send_test(webhook=hook, now=now)
        assert not listener.heard
        deliver_due(now=now)
        assert len(listener.heard) == 1

    def test_a_racer_has_ten_tests_an_hour_across_all_webhooks(self, hook, alice, bob, now):
        for minute in range(TESTS_AN_HOUR // 2):
            send_test(webhook=hook, now=now + timedelta(minutes=minute))
        hook.delete()
        other = add_webhook(owner=alice, url="https://example.org/")
        for minute in range(TESTS_AN_HOUR // 2):
            send_test(webhook=other, now=now + timedelta(minutes=minute))
        with pytest.raises(UserFault) as refused:
            send_test(webhook=other, now=now + HOUR)
        assert refused.value.code == "webhook_test_limit"
        assert WebhookDelivery.objects.count() == TESTS_AN_HOUR // 2
        send_test(webhook=add_webhook(owner=bob, url="https://example.org/"), now=now)

    def test_the_limit_resets_after_an_hour(self, alice, now, monkeypatch):
        hook = add_webhook(owner=alice, url="https://example.org/")
        kept = []
        monkeypatch.setattr(cache, "add", lambda key, value, seconds: kept.append(seconds))
        send_test(webhook=hook, now=now)  # nothing is kept: its hour is over
        assert kept == [3600]


class TestWebhookPage:
    @pytest.fixture
    def client(self, alice) -> Client:
        client = Client()
        client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
        return client

    def test_an_organiser_adds_a_webhook_sees_its_secret_and_removes_it(self, client, alice, now):
        race = a_race(now, organiser=alice)
        said = {"url": "https://example.org/x", "race": race.pk, "events": ["race.closed", "run.finished"]}
        assert client.post("/settings/webhooks/", said).status_code == 302
        hook = Webhook.objects.get()
        assert hook.events == ["run.finished", "race.closed"]
        assert hook.race == race and hook.secret in client.get("/settings/webhooks/").content.decode()
        client.post(f"/settings/webhooks/{hook.pk}/remove/")
        assert not Webhook.objects.exists()

    def test_webhooks_are_limited_in_number_and_to_own_races(self, client, alice, bob, now):
        race = a_race(now, organiser=bob)
        assert (
            client.post(
                "/settings/webhooks/", {"url": "https://example.org/", "race": race.pk, "events": EVENTS}
            ).status_code
            == 422
        )
        with pytest.raises(UserFault) as refused:
            add_webhook(owner=alice, url="https://example.org/", race=race)
        assert refused.value.code == "race_not_yours"
        for _ in range(PER_RACER):
            add_webhook(owner=alice, url="https://example.org/")
        page = client.post("/settings/webhooks/", {"url": "https://example.org/", "events": EVENTS})
        assert page.status_code == 422 and 'data-code="webhook_limit"' in page.content.decode()

    def test_the_owner_sends_a_test_and_sees_the_answer(self, client, hook, listener, settings):
        cache.clear()
        page = client.get("/settings/webhooks/").content.decode()
        assert f'action="/settings/webhooks/{hook.pk}/test/"' in page
        waiting = client.post(f"/settings/webhooks/{hook.pk}/test/", follow=True).content.decode()
        assert "Test sent." in waiting and 'hx-trigger="every 2s"' in waiting
        deliver_due(now=timezone.now())
        answered = client.get("/settings/webhooks/").content.decode()
        assert "webhook.test" in answered and "204" in answered and "hx-trigger" not in answered
        for _ in range(TESTS_AN_HOUR):
            last = client.post(f"/settings/webhooks/{hook.pk}/test/", follow=True)
        assert 'data-code="webhook_test_limit"' in last.content.decode()
        assert WebhookDelivery.objects.count() == TESTS_AN_HOUR
        assert client.get(f"/settings/webhooks/{hook.pk}/test/").status_code == 405

    def test_a_racer_cannot_test_webhooks_of_others(self, client, bob):
        hook = add_webhook(owner=bob, url="https://example.org/")
        assert client.post(f"/settings/webhooks/{hook.pk}/test/").status_code == 404
        assert Client().post(f"/settings/webhooks/{hook.pk}/test/").status_code == 302
        assert not WebhookDelivery.objects.exists()

    def test_a_racer_cannot_see_or_remove_webhooks_of_others(self, client, bob):
        hook = add_webhook(owner=bob, url="https://example.org/")
        assert hook.secret not in client.get("/settings/webhooks/").content.decode()
        assert client.post(f"/settings/webhooks/{hook.pk}/remove/").status_code == 404
        assert Client().get("/settings/webhooks/").status_code == 302

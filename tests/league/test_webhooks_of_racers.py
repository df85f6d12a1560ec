"""What a racer's webhook is told, how it is signed, and chats that are told in their own form."""

from __future__ import annotations

import json
from datetime import timedelta

import pytest
from django.core.cache import cache
from django.db import IntegrityError, transaction
from django.utils import timezone
from standardwebhooks import Webhook as Receiver
from standardwebhooks import WebhookVerificationError

from league.models import NoticeChoice, Stage, Webhook, WebhookDelivery
from league.stewarding.official_results import close_round
from league.stewarding.services import disqualify, reopen_round
from league.webhooks import payloads as chats
from league.webhooks.deliveries import deliver_due, shown
from league.webhooks.payloads import EVENTS, LABELS, WORDS
from league.webhooks.services import add_webhook, change_secret, send_test
from paddock.errors import UserFault
from races.entries.services.submissions import submit_model
from tests.docs.pages import code_blocks, text
from tests.factories import a_model, a_race, a_racer, drive, fail, laps
from tests.happened import queue_deliveries
from tests.league.seasons import HOUR, a_round, a_season, after, board, racers

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def counted_from_nothing():
    """So many tests an hour are counted in the cache."""
    cache.clear()


@pytest.fixture
def moment():
    """Now by the clock: a receiver compares the time of a delivery with its own."""
    return timezone.now()


def told(hook: Webhook) -> list[tuple[str, dict]]:
    """Event and body of all that is queued for a webhook, in the order in which it happened."""
    return [(one.event, json.loads(one.body)) for one in hook.deliveries.order_by("pk")]


class TestSigned:
    def test_the_standard_webhooks_library_verifies_a_delivery(self, hook, moment, listener):
        send_test(webhook=hook, now=moment)
        deliver_due(now=moment)
        ((headers, body),) = listener.heard
        headers = {name.lower(): value for name, value in headers.items()}
        said = Receiver(shown(hook.secret)).verify(body, headers)
        assert (said["type"], said["data"]) == ("webhook.test", {"url": hook.url})
        for wrong in (body + b" ", body.replace(b"test", b"rest")):
            with pytest.raises(WebhookVerificationError):
                Receiver(shown(hook.secret)).verify(wrong, headers)
        with pytest.raises(WebhookVerificationError):
            Receiver(shown("A" * 40)).verify(body, headers)

    def test_a_retry_keeps_its_id_and_has_a_new_timestamp(self, hook, alice, now, listener):
        listener.status = 500
        a_race(now, organiser=alice, opens_at=now - HOUR)
        queue_deliveries(now=now)
        deliver_due(now=now)
        deliver_due(now=now + timedelta(minutes=1))
        first, second = ({name.lower(): value for name, value in headers.items()} for headers, _body in listener.heard)
        assert first["webhook-id"] == second["webhook-id"]
        assert int(second["webhook-timestamp"]) - int(first["webhook-timestamp"]) == 60
        assert first["webhook-signature"] != second["webhook-signature"]

    def test_old_and_new_secrets_both_sign_for_a_day(self, hook, moment, listener):
        old = hook.secret
        hook = change_secret(webhook=hook, now=moment)
        assert hook.secret != old
        for number, later in enumerate((timedelta(0), timedelta(hours=23), timedelta(hours=24))):
            send_test(webhook=hook, now=moment + later)
            deliver_due(now=moment + later)
            headers, body = listener.heard[-1]
            signatures = headers["webhook-signature"].split()
            assert len(signatures) == (1 if number == 2 else 2)
            if number == 0:
                lower = {name.lower(): value for name, value in headers.items()}
                for secret in (old, hook.secret):
                    assert Receiver(shown(secret)).verify(body, lower)["type"] == "webhook.test"

    def test_the_database_refuses_an_old_secret_without_an_end(self, hook):
        with pytest.raises(IntegrityError), transaction.atomic():
            Webhook.objects.filter(pk=hook.pk).update(old_secret="x")


class TestDocumentationExample:
    @pytest.fixture
    def example(self) -> dict:
        names: dict = {"__name__": "example"}
        exec(code_blocks(text("webhooks.md"), "python")[0], names)
        return names

    @pytest.fixture
    def delivery(self, hook, moment, listener) -> tuple[dict[str, str], bytes]:
        send_test(webhook=hook, now=moment)
        deliver_due(now=moment)
        ((headers, body),) = listener.heard
        return {name.lower(): value for name, value in headers.items()}, body

    def test_it_accepts_a_delivery_once_and_refuses_a_replay(self, example, hook, delivery, moment):
        headers, body = delivery
        example["check"](shown(hook.secret), headers, body)
        for later in (0, 1, 299):
            with pytest.raises(example["Refused"], match="seen before"):
                example["check"](shown(hook.secret), headers, body, moment.timestamp() + later)
        for later in (302, 3600, -302):
            with pytest.raises(example["Refused"], match="too old"):
                example["check"](shown(hook.secret), headers, body, moment.timestamp() + later)

    def test_it_refuses_unsigned_deliveries_and_accepts_both_secrets(self, example, hook, delivery):
        headers, body = delivery
        for wrong in ({"webhook-signature": "v1,AAAA"}, {"webhook-id": "msg_0"}, {"webhook-signature": "v1,\xe9"}):
            with pytest.raises(example["Refused"], match="not signed"):
                example["check"](shown(hook.secret), headers | wrong, body)
        assert example["seen"] == {}, "what is refused uses up no id"
        both = headers | {"webhook-signature": f"v1,AAAA {headers['webhook-signature']}"}
        example["check"](shown(hook.secret), both, body)


class TestRacerWebhooks:
    def test_a_racer_is_told_of_runs_of_their_own_cars(self, hook, alice, bob, now):
        race = a_race(now, organiser=bob)
        drive(race, alice, laps(9_000, 9_000, 9_000), now)
        drive(race, bob, laps(8_000, 8_000, 8_000), now)
        failed = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
        fail(failed, UserFault("non_finite_action", step=17), now)
        queue_deliveries(now=now)
        (_, finished), (_, broken) = told(hook)
        assert (finished["type"], finished["race"]["slug"]) == ("run.finished", race.slug)
        assert (finished["data"]["best_lap_ms"], finished["data"]["is_best"]) == (9_000, True)
        assert (broken["type"], broken["data"]["reason"]) == ("run.failed", "non_finite_action")
        assert queue_deliveries(now=now) == 0

    @pytest.mark.parametrize(
        ("stage", "event"),
        [(Stage.OPEN, "racer.promoted"), (Stage.PRO, "racer.finale"), (Stage.FINALE, "racer.qualified")],
    )
    def test_a_racer_is_told_the_outcome_of_an_official_round(self, hook, alice, bob, stage, event):
        round_, steward = a_round(a_season(), 1, stage), a_racer(is_staff=True)
        elsewhere = add_webhook(owner=bob, url="https://example.org/")
        Webhook.objects.update(created_at=round_.race.opens_at - HOUR)
        board(round_.race, [alice, *racers(9), bob])
        close_round(round=round_, now=after(round_))
        queue_deliveries(now=after(round_))
        ((kind, body),) = told(hook)
        assert kind == event and body["data"] == {"season": round_.season.name}
        assert told(elsewhere) == [], "who was last has come to nothing"
        reopen_round(round=round_, by=steward, reason="Refresh", now=after(round_) + HOUR)
        close_round(round=round_, now=after(round_) + 2 * HOUR)
        assert queue_deliveries(now=after(round_) + 2 * HOUR) == 0, "nothing twice"

    def test_outcomes_undone_before_delivery_are_not_sent(self, hook, alice):
        round_ = a_round(a_season(), 1, Stage.OPEN)
        Webhook.objects.update(created_at=round_.race.opens_at - HOUR)
        board(round_.race, [alice, *racers(9)])
        close_round(round=round_, now=after(round_))
        reason = {"by": a_racer(is_staff=True), "reason": "Two accounts"}
        disqualify(round=round_, racer=alice, now=after(round_), **reason)
        queue_deliveries(now=after(round_))
        assert told(hook) == []

    def test_only_chosen_events_of_the_chosen_race_are_sent(self, alice, bob, now):
        mine, other = a_race(now, organiser=bob), a_race(now, organiser=bob)
        for race in (mine, other):
            drive(race, alice, laps(9_000, 9_000, 9_000), now)
        one = add_webhook(owner=alice, url="https://example.org/", race=mine)
        none = add_webhook(owner=alice, url="https://example.org/", events=["race.closed", "run.failed"])
        Webhook.objects.update(created_at=now - HOUR)
        queue_deliveries(now=now)
        assert [body["race"]["slug"] for _event, body in told(one)] == [mine.slug]
        assert told(none) == []

    def test_nobody_is_told_of_a_race_they_are_not_in(self, alice, bob, now):
        race = a_race(now, organiser=bob)
        with pytest.raises(UserFault) as refused:
            add_webhook(owner=alice, url="https://example.org/", race=race)
        assert refused.value.code == "race_not_yours"

    def test_an_unknown_event_is_refused_by_name(self, alice):
        with pytest.raises(UserFault) as refused:
            add_webhook(owner=alice, url="https://example.org/", events=["run.finished", "rain.began"])
        assert (refused.value.code, refused.value.params["event"]) == ("webhook_event", "rain.began")


class TestChats:
    @pytest.mark.parametrize(
        ("url", "chat"),
        [
            ("https://discord.com/api/webhooks/1/abc", "Discord"),
            ("https://DISCORDAPP.com/api/webhooks/1/abc", "Discord"),
            ("https://discord.com/api/webhooks/1/abc/slack", "Slack"),
            ("https://hooks.slack.com/services/T0/B0/x", "Slack"),
            ("https://discord.com.example.org/api/webhooks/1/abc", None),
            ("https://example.org/?https://discord.com/api/webhooks/1", None),
        ],
    )
    def test_a_chat_is_recognised_by_its_host(self, url, chat):
        assert chats.chat_of(url) == chat

    @pytest.mark.parametrize("chat", [chats.DISCORD, chats.SLACK])
    def test_a_chat_gets_a_sentence_in_its_owners_language(
        self, hook, alice, now, listener, monkeypatch, settings, chat
    ):
        monkeypatch.setitem(chats.HOSTS, "127.0.0.1", chat)
        race = a_race(now, organiser=alice, name="<!here> *Night* & race", opens_at=now - HOUR)
        NoticeChoice.objects.create(racer=alice, language="ko")
        queue_deliveries(now=now)
        deliver_due(now=now)
        ((headers, body),) = listener.heard
        said = json.loads(body)
        link = f"{settings.SITE_URL}/races/{race.slug}/"
        if chat == chats.DISCORD:
            assert set(said) == {"content", "allowed_mentions"} and said["allowed_mentions"] == {"parse": []}
            words, last = said["content"].split("\n")
            assert r"\<\!here\>" in words.replace("!", r"\!") and r"\*Night\*" in words
        else:
            assert set(said) == {"text"}
            words, last = said["text"].split("\n")
            assert "&lt;!here&gt; *Night* &amp; race" in words
        assert last == link and "is open" not in words, "in Korean"
        assert not [name for name in headers if name.lower().startswith(("webhook-", "x-paddock"))]
        assert WebhookDelivery.objects.get().state == "sent"

    def test_every_event_has_a_sentence_and_a_label(self):
        assert set(LABELS) == set(EVENTS) and set(WORDS) == {*EVENTS, "webhook.test"}

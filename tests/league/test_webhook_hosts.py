"""Deliveries and the hosts that they go to: whoever is away or drips keeps nobody else waiting."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.conf import settings as configured

from config.celery import app
from league import tasks
from league.models import Webhook, WebhookDelivery, WebhookHost
from league.webhooks import deliveries
from league.webhooks import outgoing_requests as outgoing
from league.webhooks.deliveries import GIVEN_UP_AFTER, LONGEST_PAUSE, deliver_due, hosts_due
from league.webhooks.services import add_webhook, send_test, tidy_webhooks

pytestmark = pytest.mark.django_db
MINUTE = timedelta(minutes=1)


class Net:
    """What hosts do: those in ``away`` cannot be reached. ``met``: who was tried, in order."""

    def __init__(self) -> None:
        self.away: set[str] = set()
        self.met: list[str] = []

    def post(self, url: str, body: bytes, headers: object, **kwargs: object) -> int:
        host = outgoing.host_of(url)
        self.met.append(host)
        if host in self.away:
            raise TimeoutError
        return 204


@pytest.fixture
def net(monkeypatch) -> Net:
    made = Net()
    monkeypatch.setattr(deliveries.outgoing, "post", made.post)
    return made


@pytest.fixture
def drips(alice, net) -> Webhook:
    net.away.add("drips.example")
    return add_webhook(owner=alice, url="https://Drips.example/a")


def told(hook: Webhook, now, many: int = 1) -> list[WebhookDelivery]:
    return [
        WebhookDelivery.objects.create(
            webhook=hook, event="run.finished", about=f"{hook.pk}-{number}", at=now, not_before=now, body="{}"
        )
        for number in range(many)
    ]


def test_tasks_waiting_for_other_servers_have_their_own_queue():
    queues = {name: app.amqp.router.route({}, name)["queue"].name for name in app.tasks if name.startswith("league.")}
    assert {name for name, queue in queues.items() if queue == "messages"} == {
        *("league.tasks.notices", "league.tasks.webhooks", "league.tasks.deliver")
    }
    assert app.amqp.router.route({}, "evaluation.tasks.work")["queue"].name == "celery"
    assert configured.EMAIL_TIMEOUT


def test_a_dripping_host_does_not_delay_another_host(drips, bob, net, now):
    told(drips, now, 10)
    told(add_webhook(owner=bob, url="https://well.example/"), now, 10)
    assert deliver_due(now=now) == 11
    assert net.met.count("drips.example") == 1 and net.met.count("well.example") == 10
    assert set(WebhookDelivery.objects.filter(webhook=drips).values_list("attempt", flat=True)) == {0, 1}


def test_a_hosts_pause_grows_without_using_up_attempts(drips, net, now):
    waiting = told(drips, now, 3)
    moment, pauses = now, []
    for _ in range(5):
        assert deliver_due(now=moment) == 1
        free = WebhookHost.objects.get().free_at
        pauses.append((free - moment) // MINUTE)
        assert deliver_due(now=free - timedelta(seconds=1)) == 0
        moment = free
    assert pauses == [1, 4, 16, 64, LONGEST_PAUSE // MINUTE]
    net.away.clear()
    assert deliver_due(now=moment) == 3, "the first that gets through sets the others free"
    assert {WebhookDelivery.objects.get(pk=one.pk).state for one in waiting} == {"sent"}
    assert WebhookHost.objects.get().failures == 0


def test_a_host_that_answered_goes_before_one_that_did_not(drips, bob, net, now):
    told(drips, now, 2)
    deliver_due(now=now)
    told(add_webhook(owner=bob, url="https://well.example/"), now + 2 * MINUTE)
    deliver_due(now=now + 2 * MINUTE)
    assert net.met == ["drips.example", "well.example", "drips.example"]


def test_an_error_response_does_not_pause_the_host_for_others(alice, bob, net, now, monkeypatch):
    one = add_webhook(owner=alice, url="https://shared.example/gone")
    other = add_webhook(owner=bob, url="https://shared.example/fine")
    monkeypatch.setattr(deliveries.outgoing, "post", lambda url, *rest, **kwargs: 404 if "gone" in url else 204)
    told(one, now), told(other, now)
    assert deliver_due(now=now) == 2
    assert dict(WebhookDelivery.objects.values_list("webhook", "state")) == {one.pk: "due", other.pk: "sent"}


@pytest.mark.parametrize(
    "nothing_there", ["https://shared.example:81/", "http://shared.example/", "http://shared.example:443/"]
)
def test_a_closed_port_does_not_pause_the_host_for_others(alice, bob, net, now, nothing_there):
    net.away.add(outgoing.host_of(nothing_there))
    bad = add_webhook(owner=alice, url=nothing_there)
    well = add_webhook(owner=bob, url="https://shared.example:443/fine")
    told(bad, now, 2)
    deliver_due(now=now)
    (waiting,) = told(well, now)
    deliver_due(now=now)
    waiting.refresh_from_db()
    assert waiting.state == "sent"


def test_a_host_gets_one_delivery_at_a_time(drips, net, now, monkeypatch):
    told(drips, now, 2)
    beside = []
    monkeypatch.setattr(deliveries.outgoing, "post", lambda *args, **kwargs: beside.append(deliver_due(now=now)) or 204)
    assert deliver_due(now=now) == 2 and beside == [0, 0]


def test_only_deliveries_to_a_long_absent_host_are_given_up(drips, bob, net, now):
    told(drips, now, 2)
    (late,) = told(add_webhook(owner=bob, url="https://well.example/"), now)
    WebhookDelivery.objects.filter(pk=late.pk).update(not_before=now + GIVEN_UP_AFTER)  # we were away ourselves
    deliver_due(now=now)
    deliver_due(now=now + GIVEN_UP_AFTER + MINUTE)
    rows = WebhookDelivery.objects.filter(webhook=drips)
    assert set(rows.values_list("state", "error")) == {("failed", "too_slow"), ("failed", "host_away")}
    late.refresh_from_db()
    assert late.state == "sent"


def test_a_test_ignores_a_pause_and_ends_it_on_success(drips, net, now):
    told(drips, now)
    deliver_due(now=now)
    net.away.clear()
    test = send_test(webhook=drips, now=now)
    assert deliver_due(now=now) == 1
    test.refresh_from_db()
    assert test.state == "sent" and WebhookHost.objects.get().free_at == now


def test_one_sender_is_woken_for_each_host_that_is_due(drips, bob, net, monkeypatch, now):
    wakes = []
    monkeypatch.setattr(tasks, "send", lambda task, times: wakes.append((task, times)))
    monkeypatch.setattr(tasks, "database_now", lambda: now)
    told(drips, now, 3)
    tasks.webhooks()
    assert wakes == [], "one host, one sender"
    for name in ("a", "b"):
        told(add_webhook(owner=bob, url=f"https://{name}.example/"), now)
    assert hosts_due(now=now) == 2
    tasks.webhooks()
    assert wakes == [("league.tasks.deliver", 1)]


def test_an_old_webhook_without_a_host_gets_one(drips, now):
    Webhook.objects.update(host="")
    tidy_webhooks(now=now)
    assert Webhook.objects.get().host == "drips.example"

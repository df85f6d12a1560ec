"""A car that fails in a live event: until its run was shown, every answer is the same as for a car that drives."""

from __future__ import annotations

import json
import re
from datetime import timedelta
from itertools import product

import pytest
from django.core.cache import cache
from django.db import transaction
from django.utils import timezone

from accounts.models import Racer
from core.events import Event
from core.personal_data.exporting import archive
from evaluation.models import Evaluation
from paddock.errors import UserFault
from races.entries.services.entries import enter_race
from races.live.commentary import story_of
from races.live.document import slot_document
from races.live.services import begin_live, call_slot, choose_model, launch, plan_live, prepare_ahead, tick_live
from races.live.streaming.event_stream import EventFeed, welcome
from races.models import LiveSlot
from tests.factories import a_model, break_down
from tests.pages.conftest import make_world
from tests.pages.test_live_walls import VIEWERS, Show, compute, fetched
from tests.soak import only

pytestmark = [pytest.mark.django_db, pytest.mark.slow]
FAULT = UserFault("policy_died", step=7, how="signal 11")
# different in every answer: tokens of forms, nonces of scripts, headers
NOISE = re.compile(
    rb"\[\('[A-Z][A-Za-z-]+', .*\Z|nonce-[\w+/=-]+|nonce=\"[^\"]+|name=\"once\" value=\"[^\"]+|[A-Za-z0-9]{64}", re.S
)
# pages that differ from one moment to the next (a download of all data says when a token was used), and pages of rows
# that a car that fails does not have
APART = re.compile(
    r"^/accounts/2fa/|^/api/v1/me/data/|^/health/ready|/package|^/admin/evaluation/(result|storedfile)/.+"
)


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch, wakes, video_wakes) -> Show:
    """Bob and carl come next, their runs queued."""
    world, now = make_world(), timezone.now()
    monkeypatch.setattr(timezone, "now", lambda: now)
    event = plan_live(
        race=world.race, by=world.alice, now=now, starts_at=now + timedelta(hours=1), rounds=1, order="as_entered"
    )
    carl = Racer.objects.create_user("carl", "carl@example.org", None)
    dora = Racer.objects.create_user("dora", "dora@example.org", None)
    for racer in (world.bob, carl, dora):
        enter_race(race=world.race, racer=racer, now=now)
        choose_model(event=event, racer=racer, model=a_model(racer), now=now)
    begin_live(event=event, by=world.alice, seen=None, now=now)
    slots = {slot.racer.entry.racer.alias: slot for slot in LiveSlot.objects.filter(event=event)}
    LiveSlot.objects.filter(event=event).exclude(pk__in=[slots["bob"].pk, slots["carl"].pk]).update(state="held")
    prepare_ahead(event=event, now=now)
    for slot in slots.values():
        slot.refresh_from_db()
    viewers = {"guest": None, "stranger": world.newcomer, "member": dora, "racer": world.bob}
    viewers |= {"organiser": world.alice, "staff": world.admin}
    return Show(world, event, slots["bob"], slots["carl"], viewers)


def drive(show: Show, *, fails: bool, launched: bool) -> None:
    """Both runs are computed; then bob's counts down, or waits where carl is called."""
    for salt, slot in enumerate((show.playing, show.coming), 1):
        if fails:
            break_down(Evaluation.with_sealed.get(pk=slot.evaluation_id), FAULT, timezone.now())
        else:
            compute(slot, salt)
    if launched:
        at = timezone.now() - timedelta(seconds=4)
        launch(event=show.event, by=show.world.alice, seen=None, now=at, slot=show.playing.pk)
    else:
        call_slot(event=show.event, by=show.world.alice, seen=None, now=timezone.now(), slot=show.coming.pk)


def answers(show: Show, viewer: str) -> dict[str, tuple[int, bytes]]:
    """Every answer of the site to this viewer, and what the stream says first and next."""
    cache.clear()
    found = {
        address: (status, NOISE.sub(b"", content))
        for address, status, content in fetched(show, viewer)
        if not APART.search(address)
    }
    race = str(show.event.race_id)
    streamed = json.dumps([welcome(race), EventFeed(race).next(True)[0]]).encode()
    events = repr(list(Event.objects.values_list("kind", "subject"))).encode()
    return found | {"stream": (200, streamed), "events": (200, events)}


@pytest.mark.parametrize(
    ("viewer", "launched"), only({("guest", True), ("racer", False)}, product(VIEWERS, (False, True)))
)
def test_nobody_sees_that_a_car_will_fail(show: Show, viewer: str, launched: bool):
    seen = []
    for fails in (False, True):
        with transaction.atomic():
            drive(show, fails=fails, launched=launched)
            seen.append(answers(show, viewer))
            transaction.set_rollback(True)
    fine, failing = seen
    assert sum(status == 200 for status, _ in fine.values()) > 40, "the walk has seen hardly anything"
    assert [address for address in fine | failing if fine.get(address) != failing.get(address)] == []


def test_a_download_of_own_data_does_not_tell_that_a_car_will_fail(show: Show):
    seen = []
    for fails in (False, True):
        with transaction.atomic():
            drive(show, fails=fails, launched=False)
            seen.append(b"".join(archive(show.world.bob, now=timezone.now())))
            transaction.set_rollback(True)
    assert seen[0] == seen[1] and b"live_events.json" in seen[0]


def test_the_event_goes_on_after_a_car_that_failed(show: Show):
    """Its run has no result, its reason is shown, and the next car comes."""
    drive(show, fails=True, launched=True)
    slot, event = show.playing, show.event
    slot.refresh_from_db()
    tick_live(now=slot.ends_at + timedelta(seconds=3))
    slot.refresh_from_db()
    assert (slot.state, slot.reason_code) == ("done", "policy_died")
    later = slot.ends_at + timedelta(seconds=4)
    assert "The run of bob has no result." in [sentence.text for sentence in story_of(event, later)]
    shown = slot_document(LiveSlot.objects.get(pk=slot.pk), later)
    assert (shown["state"], shown["reason"]) == ("done", "policy_died")
    launch(event=event, by=show.world.alice, seen=None, now=later)
    show.coming.refresh_from_db()
    assert show.coming.state == "running"

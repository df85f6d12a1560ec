"""Speed commands in a live event: who gives them, when they take effect, and that nobody sees a jump."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from evaluation.models import Evaluation, Result
from evaluation.running.queue.jobs import finish_evaluation
from paddock.rules.race import RaceRules
from paddock.rules.speed import MOST_COMMANDS
from races.live.document import live_document
from races.live.selectors.events import played
from races.live.selectors.speed import commands_speed, live_racers_commanded_by, speed_document
from races.live.services import call_slot, command_now, command_start, launch, name_deputy, tick_live
from races.live.services.speed import effect_ms
from races.models import LiveSlot, SlotState, Submission
from tests.evaluation.stubs import HEADER
from tests.factories import a_racer, lap, outcome, start
from tests.live_shows import a_show, begun, compute, racer_of, slot_of, tick_through
from tests.refusals import refused

pytestmark = pytest.mark.django_db
BACKEND = "django.contrib.auth.backends.ModelBackend"
SECOND = timedelta(seconds=1)
LEAD_S = 12  # 3 s and a twentieth of 180 s


@pytest.fixture
def alice():
    return a_racer("alice")


def a_trace(lasts_ms: int, other_from_s: float) -> bytes:
    """Two laps; from a moment on the car is elsewhere than in the run without the command."""
    rows = []
    for step in range(lasts_ms * 15 // 1000):
        x = step * 0.01 + (1.0 if step / 15 >= other_from_s else 0.0)
        where = f"{int(step * 1000 / 15 >= 20_000)},{step},{x:.5f},1.0,0.0,0.0,1.5,1,0.0,False,True,1.0,1,20.0"
        rows.append(f"{where},{step / 15},in_progress,0.0,0,0.0")
    return "\n".join([HEADER, *rows, ""]).encode()


def drive(run: Evaluation, now, salt: int, *, lap_ms: int = 20_000, other_from_s: float = 999.0) -> Evaluation:
    """Let a run end; ``other_from_s``: when it begins to differ."""
    start(run, now)
    driven = [lap(1, 20_000), {**lap(2, lap_ms), "start_ms": 20_000}]
    told = replace(outcome(driven), trace_csv=a_trace(20_000 + lap_ms, other_from_s), trace_sha256=f"{salt:064x}")
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=told, now=now)
    run.refresh_from_db()
    return run


def a_run_on_track(alice, now, **plan):
    """Bob's run, ten seconds of it played at ``at``."""
    event = begun(a_show(now, alice, ["bob"], speed_control=True, **plan), alice, now)
    slot = slot_of(event, "bob")
    drive(Evaluation.with_sealed.get(pk=slot.evaluation_id), now, 1)
    launch(event=event, by=alice, seen=None, now=now)
    slot.refresh_from_db()
    mine = racer_of(event, "bob")
    return event, slot, mine, slot.starts_at + 10 * SECOND


def commands(run: Evaluation):
    return [(one.at_ms, one.mode, one.value) for one in RaceRules.from_dict(run.spec["rules"]).speed_commands]


def command(event, mine, at, value=1.5, mode="multiplier", by=None):
    return command_now(event=event, racer=mine, by=by or mine.entry.racer, mode=mode, value=value, now=at)


class TestStart:
    def test_a_run_is_computed_anew_with_how_it_begins(self, alice, now, django_capture_on_commit_callbacks):
        event = begun(a_show(now, alice, ["bob"], speed_control=True), alice, now)
        slot, mine = slot_of(event, "bob"), racer_of(event, "bob")
        before = compute(slot, now, 9_000)
        given = {"event": event, "racer": mine, "by": mine.entry.racer, "now": now}
        with django_capture_on_commit_callbacks(execute=True):
            command_start(mode="cap", value=2.0, **given)
        slot.refresh_from_db()
        assert not Evaluation.with_sealed.filter(pk=before.pk).exists()
        run = Evaluation.with_sealed.get(pk=slot.evaluation_id)
        assert commands(run) == [(0, "cap", 2.0)]
        assert run.sealed
        refused("live_speed_often", command_start, mode="cap", value=1.0, **given)
        refused("live_speed_not_driving", command_now, mode="cap", value=1.0, **(given | {"now": now + 2 * SECOND}))

    def test_not_once_it_is_called(self, alice, now):
        event = begun(a_show(now, alice, ["bob"], speed_control=True), alice, now)
        mine = racer_of(event, "bob")
        call_slot(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now)
        given = {"event": event, "racer": mine, "by": mine.entry.racer, "now": now}
        refused("live_speed_called", command_start, mode="cap", value=2.0, **given)

    @pytest.mark.parametrize(
        ("mode", "value", "code"),
        [
            ("turbo", 1.0, "live_speed_mode"),
            ("cap", 4.1, "live_speed_value"),
            ("multiplier", float("nan"), "live_speed_value"),
            ("multiplier", float("inf"), "live_speed_value"),
            ("percent_max", -1.0, "live_speed_value"),
        ],
    )
    def test_what_is_no_command_changes_nothing(self, alice, now, mode, value, code):
        event = a_show(now, alice, ["bob"], speed_control=True)
        mine = racer_of(event, "bob")
        refused(code, command_start, event=event, racer=mine, by=mine.entry.racer, mode=mode, value=value, now=now)
        mine.refresh_from_db()
        assert (mine.speed, mine.speed_at) == (None, None)


class TestWho:
    def test_the_racer_and_their_deputy_and_nobody_else(self, alice, now):
        event = a_show(now, alice, ["bob", "carl"], speed_control=True)
        mine, bob = racer_of(event, "bob"), racer_of(event, "bob").entry.racer
        dora, staff = a_racer("dora"), a_racer("stella", is_staff=True)
        name_deputy(event=event, racer=bob, alias="DORA", now=now)
        mine.refresh_from_db()
        cast = {bob: True, dora: True, racer_of(event, "carl").entry.racer: False, alice: False, staff: False}
        for racer, may in cast.items():
            assert commands_speed(racer, mine) is may, racer
            assert live_racers_commanded_by(racer).filter(pk=mine.pk).exists() is may, racer
            if not may:
                refused(
                    "live_speed_not_yours",
                    command_start,
                    event=event,
                    racer=mine,
                    by=racer,
                    mode="cap",
                    value=1.0,
                    now=now,
                )
        assert not commands_speed(None, mine)
        assert not live_racers_commanded_by(None).exists()
        name_deputy(event=event, racer=bob, alias="", now=now)
        mine.refresh_from_db()
        assert not commands_speed(dora, mine)

    def test_who_is_no_deputy(self, alice, now):
        event = a_show(now, alice, ["bob"], speed_control=True)
        bob = racer_of(event, "bob").entry.racer
        refused("live_deputy_unknown", name_deputy, event=event, racer=bob, alias="nobody", now=now)
        refused("live_deputy_self", name_deputy, event=event, racer=bob, alias="bob", now=now)
        refused("live_not_in", name_deputy, event=event, racer=alice, alias="bob", now=now)

    def test_not_where_the_event_has_none_nor_after_its_end(self, alice, now):
        event = a_show(now, alice, ["bob"])
        mine = racer_of(event, "bob")
        given = {"event": event, "racer": mine, "by": mine.entry.racer, "mode": "cap", "value": 1.0, "now": now}
        refused("live_speed_off", command_start, **given)
        type(event).objects.filter(pk=event.pk).update(speed_control=True, state="ended", begun_at=now, ended_at=now)
        refused("live_over", command_start, **given)
        refused("live_over", command_now, **given)


class TestWhilePlayed:
    def test_the_run_with_the_command_plays_on_without_a_jump(self, alice, now):
        event, slot, mine, at = a_run_on_track(alice, now)
        slot = command(event, mine, at)
        effect = slot.speed_next["at_ms"]
        assert effect == effect_ms(event, 10_000) == (10 + LEAD_S) * 1000
        old, new = slot.evaluation_id, slot.speed_run
        assert (new.sealed, commands(new)) == (True, [(effect, "multiplier", 1.5)])
        drive(new, at, 2, lap_ms=16_000, other_from_s=effect / 1000)
        before, _over = played(slot, at + 2 * SECOND)
        told = speed_document(event, mine, at + 2 * SECOND)
        tick_live(now=at + 2 * SECOND)
        slot.refresh_from_db()
        assert slot.evaluation_id == new.pk
        assert slot.ends_at == slot.starts_at + 36 * SECOND
        assert not Evaluation.with_sealed.filter(pk=old).exists()
        assert played(slot, at + 2 * SECOND)[0] == before
        # that it was computed is not told before its moment
        assert speed_document(event, mine, at + 2 * SECOND) == told
        assert live_document(event, at + 2 * SECOND)["current"]["speed"] is None
        due = slot.starts_at + timedelta(milliseconds=effect)
        tick_through(at + 2 * SECOND, due)
        shown = live_document(event, due)["current"]["speed"]
        assert shown == {"at_ms": effect, "mode": "multiplier", "value": 1.5, "by": "bob"}
        assert speed_document(event, mine, due)["coming"] is None
        tick_through(due, slot.ends_at + 3 * SECOND)
        run = Submission.objects.get().evaluation
        assert (run.pk, commands(run)) == (new.pk, [(effect, "multiplier", 1.5)])

    @pytest.mark.parametrize("other_from_s", [None, 3.0], ids=["not computed in time", "not equal before"])
    def test_else_the_old_run_stays_and_it_expires(self, alice, now, other_from_s):
        event, slot, mine, at = a_run_on_track(alice, now)
        slot = command(event, mine, at)
        old, new = slot.evaluation_id, slot.speed_run
        if other_from_s is not None:
            drive(new, at, 2, other_from_s=other_from_s)
        for second in range(LEAD_S + 1):
            tick_live(now=at + second * SECOND)
        slot.refresh_from_db()
        assert (slot.evaluation_id, slot.speed_log, slot.speed_next) == (old, None, None)
        assert speed_document(event, mine, at + LEAD_S * SECOND)["reason"] == "live_speed_late"
        assert not Evaluation.with_sealed.filter(pk=new.pk).exists()

    def test_one_is_computed_at_a_time_and_the_last_that_waits_wins(self, alice, now):
        event, slot, mine, at = a_run_on_track(alice, now)
        first = command(event, mine, at, 1.1).speed_run
        for number, value in enumerate((1.2, 1.3), 1):
            slot = command(event, mine, at + 2 * number * SECOND, value)
            assert slot.speed_run == first
        assert Evaluation.with_sealed.filter(sealed=True).count() == 2
        due = at + LEAD_S * SECOND
        drive(first, at, 2)
        tick_through(at + 4 * SECOND, due)
        slot.refresh_from_db()
        last = (10 + 2 * LEAD_S) * 1000
        assert commands(slot.speed_run) == [((10 + LEAD_S) * 1000, "multiplier", 1.1), (last, "multiplier", 1.3)]
        assert slot.speed_wish is None

    def test_the_end_throws_away_what_was_not_adopted(self, alice, now):
        event, slot, mine, _at = a_run_on_track(alice, now)
        new = command(event, mine, slot.ends_at - SECOND).speed_run
        refused("live_speed_not_driving", command, event=event, mine=mine, at=slot.ends_at + SECOND)
        tick_live(now=slot.ends_at + 3 * SECOND)
        slot.refresh_from_db()
        assert (slot.state, slot.speed_next, slot.speed_run_id) == (SlotState.DONE, None, None)
        assert not Evaluation.with_sealed.filter(pk=new.pk).exists()
        assert not Result.with_sealed.filter(evaluation__sealed=True).exists()

    def test_at_most_two_hundred(self, alice, now):
        event, slot, mine, at = a_run_on_track(alice, now)
        log = [{"at_ms": n, "mode": "cap", "value": 1.0, "by": "bob"} for n in range(MOST_COMMANDS)]
        LiveSlot.objects.filter(pk=slot.pk).update(speed_log=log)
        refused("live_speed_full", command, event=event, mine=mine, at=at)


class TestPages:
    def test_who_has_the_page_and_commands_by_it(self, alice, client):
        now = timezone.now()
        event = a_show(now, alice, ["bob", "carl"], speed_control=True)
        bob = racer_of(event, "bob").entry.racer
        dora = a_racer("dora")
        page = reverse("live_speed", args=[event.race.slug])
        client.force_login(bob, backend=BACKEND)
        assert client.get(page).status_code == 200
        assert client.post(page, {"deputy": "dora"}).status_code == 302
        assert client.post(page, {"mode": "cap", "value": "2", "when": "start"}).status_code == 302
        assert racer_of(event, "bob").speed == {"mode": "cap", "value": 2.0, "by": "bob"}
        assert client.post(page, {"mode": "cap", "value": "x", "when": "start"}).status_code == 422
        client.force_login(dora, backend=BACKEND)
        assert client.get(page).status_code == 404
        answer = client.get(f"{page}?racer=bob")
        assert b"at most 2 m/s" in answer.content
        assert b"speed-deputy" not in answer.content
        for other in (alice, a_racer("stella", is_staff=True), a_racer("mallory")):
            client.force_login(other, backend=BACKEND)
            assert client.get(f"{page}?racer=bob").status_code == 404
            asked = {"racer": "bob", "when": "now", "mode": "cap", "value": 1}
            answer = client.post(f"/api/v1/races/{event.race.slug}/live/speed/", asked, "application/json")
            assert answer.json()["code"] == "live_speed_not_yours"
        type(event).objects.filter(pk=event.pk).update(speed_control=False)
        client.force_login(bob, backend=BACKEND)
        assert client.get(page).status_code == 404

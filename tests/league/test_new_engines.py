"""What the league makes of a race that is being repeated with another engine: who is told, and when it is official."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import translation

from accounts.models import Racer
from league.models import Lead, Notice, Webhook
from league.notices.sentences import sentence
from league.racers.selectors import honours_of
from league.stewarding.official_results import cars_on_the_way, close_due_rounds, close_round
from paddock.errors import UserFault
from races.entries.selectors.visibility import races_visible_to
from races.entries.services.entries import withdraw
from races.entries.services.redrives import drive_again, sweep_redrives
from races.models import Race
from tests.factories import a_race, a_racer, drive, laps
from tests.happened import queue_deliveries, tell_what_happened
from tests.league.seasons import a_round, a_season, after
from tests.redrives import SITE, break_down, end, everything, pending, shown

pytestmark = pytest.mark.django_db
OLD, NEW = "engine-of-before", "engine-of-now"
MINUTE = timedelta(minutes=1)


@pytest.fixture
def site(monkeypatch):
    """``site(engine)``: from now on this site drives with it. Before that, with the old one."""
    monkeypatch.setattr(SITE, OLD)
    return lambda engine: monkeypatch.setattr(SITE, engine)


@pytest.fixture
def cast(site) -> list[Racer]:
    return [a_racer(name) for name in ("ann", "bob", "cat")]


def filled(race: Race, cast: list[Racer], now) -> Race:
    """Ann has 10 s, bob 11 s, and cat 12 s."""
    for number, racer in enumerate(cast):
        drive(race, racer, laps(*[10_000 + 1000 * number] * 3), now)
    race.refresh_from_db()
    return race


def upgraded(race: Race, site, now, *times: int) -> None:
    """The site gets the new engine, and it drives these times."""
    site(NEW)
    sweep_redrives(now=now)
    for one, time_ms in zip(pending(race), times, strict=True):
        end(one, laps(*[time_ms] * 3), now)
    sweep_redrives(now=now)


def told(racer: Racer, now) -> list[str]:
    """What a racer is told at this moment and was not before."""
    known = set(Notice.objects.values_list("pk", flat=True))
    tell_what_happened(now=now)
    with translation.override("en"):
        return [sentence(one) for one in Notice.objects.filter(racer=racer).exclude(pk__in=known)]


class TestWhoIsTold:
    def test_only_racers_whose_time_changed_are_told_once(self, cast, site, now):
        race = filled(a_race(now, name="Night Race"), cast, now)
        tell_what_happened(now=now)
        upgraded(race, site, now + MINUTE, 12_500, 11_000, 8_000)
        ann, bob, cat = cast
        later = now + 2 * MINUTE
        assert told(ann, later) == [
            f"Night Race was repeated with the engine {NEW}. Your result: 0:12.500 (place 3) "
            f"(before, with {OLD}: 0:10.000 (place 1))."
        ]
        assert [one.kind for one in Notice.objects.filter(racer=cat).order_by("pk")][-1] == "retimed"
        assert not Notice.objects.filter(racer=bob, kind="retimed").exists()
        assert tell_what_happened(now=later + MINUTE) == 0

    def test_a_former_leader_is_not_told_of_being_overtaken(self, cast, site, now):
        race = filled(a_race(now), cast, now)
        tell_what_happened(now=now)
        upgraded(race, site, now + MINUTE, 10_000, 9_000, 12_000)
        assert told(cast[0], now + 2 * MINUTE) == []
        assert Lead.objects.get(race=race).racer == cast[1]

    def test_a_better_car_sent_meanwhile_is_not_a_retiming(self, cast, site, now):
        race = filled(a_race(now, name="Night Race"), cast[:1], now)
        tell_what_happened(now=now)
        site(NEW)
        sweep_redrives(now=now)
        drive(race, cast[0], laps(7_000, 7_000, 7_000), now)
        end(pending(race)[0], laps(9_000, 9_000, 9_000), now)
        sweep_redrives(now=now)
        again, result = sorted(told(cast[0], now + MINUTE), reverse=True), "Your car in Night Race: 0:07.000."
        assert again[0].startswith(result) and again[0].endswith("2.000 s faster than before.")
        assert again[1].endswith(f"Your result: 0:09.000 (before, with {OLD}: 0:10.000 (place 1)).")

    def test_a_racer_is_told_why_a_car_lost_its_time(self, cast, site, now):
        race = filled(a_race(now), cast[:1], now)
        tell_what_happened(now=now)
        site(NEW)
        sweep_redrives(now=now)
        break_down(pending(race)[0], UserFault("policy_died", step=3, how="signal 11"), now)
        sweep_redrives(now=now)
        (said,) = told(cast[0], now + MINUTE)
        assert "0:10.000 (place 1)" in said and "Your result: no classified time" in said and "signal 11" in said

    def test_a_racer_who_left_is_told_nothing(self, cast, site, now):
        race = filled(a_race(now), cast, now)
        tell_what_happened(now=now)
        withdraw(entry=race.entries.get(racer=cast[0]), now=now)
        upgraded(race, site, now + MINUTE, 9_000, 9_100, 9_200)
        assert told(cast[0], now + 2 * MINUTE) == []

    def test_a_result_sent_meanwhile_is_announced_when_it_counts(self, cast, site, now):
        race = filled(a_race(now, name="Night Race"), cast[:2], now)
        tell_what_happened(now=now)
        site(NEW)
        sweep_redrives(now=now)
        drive(race, cast[2], laps(9_000, 9_000, 9_000), now)
        assert told(cast[2], now) == []
        for one in pending(race):
            end(one, laps(10_000, 10_000, 10_000), now)
        sweep_redrives(now=now)
        assert told(cast[2], now + MINUTE) == [
            "Your car in Night Race: 0:09.000. Place 1 of 3. Your first result in this race."
        ]

    def test_a_result_not_announced_before_is_announced_once(self, cast, site, now):
        race = filled(a_race(now), cast[:1], now)
        upgraded(race, site, now, 10_000)
        assert len([said for said in told(cast[0], now + MINUTE) if said.startswith("Your car in")]) == 1
        assert told(cast[0], now + 2 * MINUTE) == []

    def test_webhooks_are_not_told_of_redriven_runs(self, cast, site, now):
        organiser = a_racer("organiser")
        race = filled(a_race(now, organiser=organiser), cast, now)
        hooks = [Webhook.objects.create(owner=one, url="https://example.org") for one in (organiser, cast[0])]
        upgraded(race, site, now + MINUTE, 9_000, 9_100, 9_200)
        Webhook.objects.update(created_at=now)
        assert queue_deliveries(now=now + 2 * MINUTE) == 0
        drive(race, cast[0], laps(8_000, 8_000, 8_000), now + 2 * MINUTE)
        queue_deliveries(now=now + 2 * MINUTE)
        told_of = [[one.event for one in hook.deliveries.all()] for hook in hooks]
        assert told_of == [["race.result"], ["run.finished"]]


class TestOfficialResults:
    def test_results_become_official_only_after_the_redrive(self, cast, site):
        round_ = a_round(a_season(), 1, "open-qualifier")
        race, during = round_.race, round_.race.closes_at - MINUTE
        filled(race, cast, during)
        site(NEW)
        assert sweep_redrives(now=during) == 3
        closed = after(round_)
        with pytest.raises(UserFault) as refused:
            close_round(round=round_, now=closed)
        assert refused.value.code == "round_still_driving"
        assert close_due_rounds(now=closed) == []
        for one in pending(race):
            end(one, laps(9_000, 9_000, 9_000), closed)
        sweep_redrives(now=closed)
        assert close_due_rounds(now=closed) == [round_]
        assert Race.objects.get(pk=race.pk).engine == NEW

    def test_official_results_are_never_redriven(self, cast, site):
        round_ = a_round(a_season(), 1, "open-qualifier")
        filled(round_.race, cast, round_.race.closes_at - MINUTE)
        close_round(round=round_, now=after(round_))
        # whatever else says that there is something to do
        Race.objects.filter(pk=round_.race_id).update(next_engine=NEW)
        before = shown(round_.race)
        site(NEW)
        assert sweep_redrives(now=after(round_)) == drive_again(race=round_.race, now=after(round_)) == 0
        race = Race.objects.get(pk=round_.race_id)
        assert (shown(race), race.engine, race.next_engine) == (before, OLD, "")

    def test_a_closed_race_without_pending_runs_keeps_its_engine(self, cast, site):
        round_ = a_round(a_season(), 1, "open-qualifier")
        filled(round_.race, cast, round_.race.closes_at - MINUTE)
        before = everything(round_.race)
        site(NEW)
        assert sweep_redrives(now=after(round_)) == 0
        assert close_due_rounds(now=after(round_)) == [round_]
        assert everything(round_.race) == before

    def test_community_races_and_honours_wait_for_the_redrive_too(self, cast, site, now):
        race = filled(a_race(now), cast, now)
        site(NEW)
        sweep_redrives(now=now)
        closed = race.closes_at + MINUTE
        assert cars_on_the_way(Race.objects.get(pk=race.pk)) == 3
        assert honours_of(cast[0], races_visible_to(None), closed).wins == 0
        for one in pending(race):
            end(one, laps(9_000, 9_000, 9_000), closed)
        sweep_redrives(now=closed)
        assert cars_on_the_way(Race.objects.get(pk=race.pk)) == 0
        assert honours_of(cast[0], races_visible_to(None), closed).wins == 1

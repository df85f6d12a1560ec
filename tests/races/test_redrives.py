"""A race has one engine: when the site's is another one, its runs are driven again and count together."""

from __future__ import annotations

import importlib
from datetime import timedelta

import pytest
from django.apps import apps
from django.db import IntegrityError, transaction

from evaluation.line import BACKGROUND
from evaluation.models import Evaluation, State
from evaluation.selectors import queue_length
from evaluation.services import claim_next_evaluation, stop_evaluation
from evaluation.services.nodes import start_worker
from faults import PlatformFault, UserFault
from races.models import Draw, Duel, DuelState, Entry, Race, Redrive, RedriveState, Retiming, Submission
from races.selectors import can_see_evaluation, evaluations_visible_to
from races.selectors.counting import DrivenAgain, driven_again
from races.selectors.results import result_of
from races.services import (
    cancel_race,
    draw_duels,
    drive_all_on,
    drive_on,
    enter_race,
    recompute_race,
    redrives,
    repeat_submission,
    submit_model,
    withdraw,
)
from races.services.redrives import drive_again, sweep_redrives
from tests.duels import a_duel_race, driving, end_all, qualify, ranking
from tests.duels import end as end_heat
from tests.factories import a_model, a_race, a_racer, drive, fail, finish, laps, start
from tests.redrives import SITE, break_down, end, everything, pending, shown

pytestmark = pytest.mark.django_db
OLD, NEW, NEWEST = "engine-of-before", "engine-of-now", "engine-after-that"
MINUTE = timedelta(minutes=1)
OURS, THEIRS = PlatformFault("internal_error"), UserFault("policy_died", step=3, how="signal 11")


@pytest.fixture
def site(monkeypatch):
    """``site(engine)``: from now on this site drives with it. Before that, with the old one."""

    def upgrade(engine: str) -> None:
        monkeypatch.setattr(SITE, engine)

    upgrade(OLD)
    return upgrade


@pytest.fixture
def cast(site):
    return [a_racer(name) for name in ("ann", "bob", "cat")]


@pytest.fixture
def race(cast, now) -> Race:
    """An open race: ann has 10 s, bob 11 s, and cat 12 s."""
    race = a_race(now)
    for number, racer in enumerate(cast):
        drive(race, racer, laps(*[10_000 + 1000 * number] * 3), now)
    race.refresh_from_db()
    return race


@pytest.fixture
def upgraded(race, site, now) -> Race:
    """The same on a site with the new engine, whose sweep has queued the three runs."""
    site(NEW)
    assert sweep_redrives(now=now) == 3
    return race


def fresh(race: Race) -> Race:
    return Race.objects.get(pk=race.pk)


def again(race: Race, now, *times: int) -> None:
    """Let the pending runs end with laps of these times, in the order of the cast."""
    waiting = pending(race)
    assert len(waiting) == len(times)
    for one, time_ms in zip(waiting, times, strict=True):
        end(one, laps(*[time_ms] * 3), now)


class TestTheEngineOfARace:
    def test_the_first_result_names_it_and_a_race_without_results_has_none(self, cast, site, now):
        race = a_race(now)
        submission = submit_model(race=race, racer=cast[0], model=a_model(cast[0]), now=now)
        assert fresh(race).engine == ""
        site(NEW)
        assert sweep_redrives(now=now) == 0
        finish(submission, laps(9_000, 9_000, 9_000), now)
        assert (fresh(race).engine, fresh(race).next_engine) == (NEW, "")
        assert shown(race) == [("ann", 9_000)]

    def test_races_of_before_have_that_of_their_results(self, race, now):
        empty = a_race(now)
        Race.objects.update(engine="")
        importlib.import_module("races.migrations.0011_one_engine").name_engines(apps, None)
        assert (fresh(race).engine, fresh(empty).engine) == (OLD, "")

    def test_on_a_site_with_the_same_engine_nothing_happens(self, race, now):
        before = everything(race)
        assert sweep_redrives(now=now) == drive_again(race=race, now=now) == 0
        assert everything(race) == before and not Redrive.objects.exists()


class TestDrivingAgain:
    def test_each_counted_run_is_queued_once_exactly_as_it_was_frozen(self, upgraded, now):
        race = upgraded
        assert sweep_redrives(now=now) == drive_again(race=race, now=now) == 0
        for one in pending(race):
            old, new = one.submission.evaluation, one.evaluation
            for name in ("spec", "model_id", "track_id", "owner_id"):
                assert getattr(new, name) == getattr(old, name)
            assert (new.state, new.priority, one.engine) == (State.QUEUED, BACKGROUND, NEW)
        assert Redrive.objects.count() == 3

    def test_only_one_can_be_under_way_for_a_submission(self, upgraded, now):
        first, second, _third = pending(upgraded)
        with pytest.raises(IntegrityError), transaction.atomic():
            Redrive.objects.filter(pk=second.pk).update(submission=first.submission)

    def test_the_board_stands_until_the_last_and_then_all_count_together(self, upgraded, now):
        race = upgraded
        before = everything(race)
        first, second, third = pending(race)
        end(third, laps(8_000, 8_000, 8_000), now)
        end(first, laps(10_500, 10_500, 10_500), now)
        assert sweep_redrives(now=now) == 0
        assert everything(race) == [{**before[0], "next_engine": NEW}, *before[1:]]
        assert driven_again(fresh(race)) == DrivenAgain(NEW, done=2, runs=3)
        end(second, laps(11_000, 11_000, 11_000), now)
        sweep_redrives(now=now)
        assert shown(race) == [("cat", 8_000), ("ann", 10_500), ("bob", 11_000)]
        done = fresh(race)
        assert (done.engine, done.next_engine, done.fastest_lap_ms) == (NEW, "", 8_000)
        assert driven_again(done) is None
        assert not Redrive.objects.exclude(state=RedriveState.TAKEN).exists()
        # what was worked out at once is what the runs themselves say
        stands = everything(race)
        recompute_race(race=done)
        assert everything(race) == stands

    def test_the_end_of_the_last_run_lets_them_count_without_a_sweep(self, upgraded, now, commits):
        again(upgraded, now, 9_000, 9_100, 9_200)
        assert shown(upgraded) == [("ann", 9_000), ("bob", 9_100), ("cat", 9_200)]

    def test_it_costs_no_submission_and_the_runs_of_before_are_kept(self, upgraded, now):
        old = set(Submission.objects.values_list("evaluation", flat=True))
        again(upgraded, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        assert list(Entry.objects.values_list("submission_count", "last_number").distinct()) == [(1, 1)]
        assert set(Redrive.objects.values_list("replaced", flat=True)) == old
        assert Evaluation.objects.filter(pk__in=old, result__engine=OLD).count() == 3
        assert Submission.objects.filter(evaluation__result__engine=NEW, is_void=False).count() == 3

    def test_those_whose_time_changed_are_written_down_with_both_places(self, upgraded, now):
        again(upgraded, now, 12_500, 11_000, 8_000)
        sweep_redrives(now=now)
        rows = Retiming.objects.order_by("entry").values_list(
            "entry__racer__alias", "old_score_ms", "old_rank", "new_score_ms", "new_rank", "old_engine", "new_engine"
        )
        assert list(rows) == [("ann", 10_000, 1, 12_500, 3, OLD, NEW), ("cat", 12_000, 3, 8_000, 1, OLD, NEW)]

    def test_the_best_of_several_cars_may_be_another_one(self, race, cast, site, now):
        second = drive(race, cast[0], laps(10_200, 10_200, 10_200), now)
        site(NEW)
        assert sweep_redrives(now=now) == 4
        for one in pending(race):
            slow = one.submission != second and one.submission.entry.racer == cast[0]
            end(one, laps(*[10_400 if slow else 10_100] * 3), now)
        sweep_redrives(now=now)
        assert Entry.objects.get(race=race, racer=cast[0]).best == second

    def test_nobody_waits_for_it_and_it_is_no_turn_of_its_racer(self, upgraded, cast, now):
        ann, bob, _ = cast
        assert queue_length() == 0
        mine = submit_model(race=upgraded, racer=ann, model=a_model(ann), now=now + MINUTE)
        other = submit_model(race=upgraded, racer=bob, model=a_model(bob), now=now + 2 * MINUTE)
        start(pending(upgraded)[0].evaluation, now + 3 * MINUTE)
        order = [claim_next_evaluation(worker="w", now=now + 4 * MINUTE) for _ in range(3)]
        assert [order[0], order[1]] == [mine.evaluation, other.evaluation]
        assert order[2].priority == BACKGROUND

    def test_only_operators_see_a_run_before_its_race_has_taken_it(self, upgraded, cast, now):
        one = pending(upgraded)[0]
        readers = [(None, False), (cast[0], False), (cast[1], False), (a_racer("admin", is_staff=True), True)]
        for reader, sees in readers:
            assert can_see_evaluation(reader, one.evaluation) is sees
            assert evaluations_visible_to(reader).filter(pk=one.evaluation_id).exists() is sees
        again(upgraded, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        for reader, _ in readers:
            assert can_see_evaluation(reader, one.evaluation)
            assert evaluations_visible_to(reader).filter(pk=one.evaluation_id).exists()

    def test_who_has_withdrawn_is_driven_again_too_and_comes_back_with_the_new_time(self, race, cast, site, now):
        withdraw(entry=Entry.objects.get(race=race, racer=cast[0]), now=now)
        site(NEW)
        assert sweep_redrives(now=now) == 3
        again(race, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        assert shown(race) == [("bob", 9_100), ("cat", 9_200)]
        enter_race(race=fresh(race), racer=cast[0], now=now)
        assert shown(race)[0] == ("ann", 9_000)
        assert fresh(race).fastest_lap_ms == 9_000

    def test_a_deleted_model_is_driven_again_for_its_result_stands(self, race, site, now):
        Evaluation.objects.get(owner__alias="ann").model.__class__.objects.update(deleted_at=now)
        site(NEW)
        assert sweep_redrives(now=now) == 3


class TestCarsSentMeanwhile:
    def test_are_held_back_until_all_count_together(self, upgraded, cast, now):
        race = upgraded
        before = shown(race)
        held = drive(race, cast[2], laps(7_000, 7_000, 7_000), now)
        newcomer = drive(race, a_racer("dan"), laps(9_500, 9_500, 9_500), now)
        assert shown(race) == [*before, ("dan", None)]
        assert result_of(held, held.evaluation.result.laps, tell_earlier=True).is_held
        assert fresh(race).fastest_lap_ms == 10_000
        again(race, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        assert shown(race) == [("cat", 7_000), ("ann", 9_000), ("bob", 9_100), ("dan", 9_500)]
        assert not result_of(
            Submission.objects.get(pk=newcomer.pk), newcomer.evaluation.result.laps, tell_earlier=True
        ).is_held
        assert Entry.objects.get(race=race, racer=cast[2]).submission_count == 2

    def test_one_that_is_faster_than_the_sweep_makes_the_race_be_driven_again(self, race, cast, site, now):
        before = shown(race)
        site(NEW)
        drive(race, cast[2], laps(7_000, 7_000, 7_000), now)
        assert (shown(race), fresh(race).next_engine) == (before, NEW)
        assert sweep_redrives(now=now) == 3

    def test_a_late_result_of_the_old_engine_is_held_back_and_driven_again(self, upgraded, cast, site, now):
        race = upgraded
        late = submit_model(race=race, racer=cast[0], model=a_model(cast[0]), now=now)
        again(race, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        site(OLD)
        finish(late, laps(5_000, 5_000, 5_000), now)
        site(NEW)
        assert shown(race)[0] == ("ann", 9_000)
        told = Retiming.objects.count()
        assert sweep_redrives(now=now) == 1
        again(race, now, 8_500)
        sweep_redrives(now=now)
        assert shown(race)[0] == ("ann", 8_500)
        assert Retiming.objects.count() == told  # the race has the same engine as before: the car is just faster


class TestARaceThatIsOver:
    def test_keeps_its_engine_and_its_board(self, race, site, now):
        site(NEW)
        before = everything(race)
        assert sweep_redrives(now=race.closes_at) == drive_again(race=race, now=race.closes_at) == 0
        assert everything(race) == before

    def test_one_that_closes_meanwhile_is_driven_to_the_end(self, upgraded, now):
        race, closed = upgraded, upgraded.closes_at + MINUTE
        again(race, closed, 9_000, 9_100, 9_200)
        sweep_redrives(now=closed)
        assert (shown(race)[0], fresh(race).engine) == (("ann", 9_000), NEW)
        assert sweep_redrives(now=closed) == 0

    def test_a_car_that_was_queued_when_it_closed_makes_it_be_driven_again(self, race, cast, site, now):
        late = submit_model(race=race, racer=cast[2], model=a_model(cast[2]), now=now)
        site(NEW)
        assert sweep_redrives(now=race.closes_at) == 3
        finish(late, laps(7_000, 7_000, 7_000), race.closes_at)
        again(race, race.closes_at, 9_000, 9_100, 9_200)
        sweep_redrives(now=race.closes_at)
        assert shown(race)[0] == ("cat", 7_000)

    def test_no_run_is_repeated_there_with_another_engine(self, race, cast, site, now):
        failed = submit_model(race=race, racer=cast[0], model=a_model(cast[0]), now=now)
        fail(failed, OURS, now)
        site(NEW)
        with pytest.raises(UserFault) as refused:
            repeat_submission(submission=failed, now=race.closes_at)
        assert refused.value.code == "race_engine_gone"
        assert {OLD, NEW} == set(refused.value.params.values())
        assert repeat_submission(submission=failed, now=now).number == 3

    def test_one_that_is_cancelled_meanwhile_is_driven_no_further(self, upgraded, now, commits):
        before = shown(upgraded)
        end(pending(upgraded)[0], laps(9_000, 9_000, 9_000), now)
        cancel_race(race=upgraded, reason="Rain.", now=now)
        assert sweep_redrives(now=now) == 0
        assert (shown(upgraded), fresh(upgraded).engine, fresh(upgraded).next_engine) == (before, OLD, "")
        assert set(Redrive.objects.values_list("state", "evaluation__state")) == {
            ("dropped", "finished"),
            ("dropped", "stopped"),
        }


class TestRunsThatFail:
    def test_by_the_car_leave_it_without_a_time_and_give_the_submission_back(self, upgraded, cast, now):
        first, second, third = pending(upgraded)
        break_down(first, THEIRS, now)
        end(second, laps(11_000, 11_000, 11_000), now)
        end(third, laps(12_000, 12_000, 12_000), now)
        sweep_redrives(now=now)
        assert shown(upgraded) == [("bob", 11_000), ("cat", 12_000), ("ann", None)]
        submission = Submission.objects.get(entry__racer=cast[0])
        assert (submission.is_void, submission.refunded, submission.evaluation) == (True, True, first.evaluation)
        assert submission.entry.submission_count == 0
        told = Retiming.objects.get()
        assert (told.old_score_ms, told.new_score_ms, told.reason_code) == (10_000, None, "policy_died")

    def test_by_us_are_queued_again_after_growing_pauses_and_the_board_stands(self, upgraded, now):
        before = shown(upgraded)
        first, second, third = pending(upgraded)
        end(second, laps(9_100, 9_100, 9_100), now)
        end(third, laps(9_200, 9_200, 9_200), now)
        at = now
        for pause in (1, 4, 16, 60, 60):
            (waiting,) = [one for one in pending(upgraded) if one.submission == first.submission]
            break_down(waiting, OURS, at)
            assert sweep_redrives(now=at + pause * MINUTE - timedelta(seconds=1)) == 0
            at += pause * MINUTE
            assert sweep_redrives(now=at) == 1
            assert driven_again(fresh(upgraded)) == DrivenAgain(NEW, done=2, runs=3)
        assert shown(upgraded) == before
        (waiting,) = [one for one in pending(upgraded) if one.submission == first.submission]
        assert waiting.tries == 6
        end(waiting, laps(9_000, 9_000, 9_000), at)
        sweep_redrives(now=at)
        assert shown(upgraded)[0] == ("ann", 9_000)

    def test_an_operator_who_stops_one_lets_the_race_go_on_without_it(self, upgraded, now):
        first, second, third = pending(upgraded)
        stop_evaluation(evaluation=first.evaluation, now=now)
        end(second, laps(9_100, 9_100, 9_100), now)
        end(third, laps(9_200, 9_200, 9_200), now)
        sweep_redrives(now=now)
        assert shown(upgraded) == [("bob", 9_100), ("cat", 9_200), ("ann", None)]

    def test_a_car_that_failed_under_the_old_engine_keeps_its_verdict(self, race, cast, site, now):
        failed = submit_model(race=race, racer=cast[0], model=a_model(cast[0]), now=now)
        fail(failed, THEIRS, now)
        site(NEW)
        assert sweep_redrives(now=now) == 3


class TestAnotherChangeOfTheEngine:
    def test_begins_anew_whatever_the_first_has_driven(self, upgraded, site, now, commits):
        race, before = upgraded, shown(upgraded)
        first, second, _third = pending(race)
        end(first, laps(9_000, 9_000, 9_000), now)
        start(second.evaluation, now)
        site(NEWEST)
        assert sweep_redrives(now=now) == 3
        assert shown(race) == before
        assert Redrive.objects.filter(engine=NEW, state=RedriveState.DROPPED).count() == 3
        assert set(Evaluation.objects.filter(redrive__engine=NEW).values_list("state", flat=True)) == {
            "finished",
            "stopped",
        }
        again(race, now, 8_000, 8_100, 8_200)
        assert (shown(race)[0], fresh(race).engine) == (("ann", 8_000), NEWEST)
        assert set(Retiming.objects.values_list("old_engine", "new_engine")) == {(OLD, NEWEST)}

    def test_back_to_the_one_before_leaves_the_board_and_drives_what_came_meanwhile(self, upgraded, cast, site, now):
        race = upgraded
        drive(race, cast[2], laps(7_000, 7_000, 7_000), now)
        site(OLD)
        assert sweep_redrives(now=now) == 1
        assert [one.submission.entry.racer for one in pending(race)] == [cast[2]]
        again(race, now, 9_500)
        sweep_redrives(now=now)
        assert shown(race) == [("cat", 9_500), ("ann", 10_000), ("bob", 11_000)]
        assert (fresh(race).engine, fresh(race).next_engine) == (OLD, "")

    def test_back_with_nothing_sent_meanwhile_drops_everything(self, upgraded, site, now, commits):
        before = shown(upgraded)
        site(OLD)
        assert sweep_redrives(now=now) == 0
        assert (shown(upgraded), fresh(upgraded).next_engine, pending(upgraded)) == (before, "", [])

    def test_a_result_of_an_old_worker_is_of_no_use(self, upgraded, site, now):
        one = pending(upgraded)[0]
        site(OLD)
        end(one, laps(9_000, 9_000, 9_000), now)
        site(NEW)
        assert sweep_redrives(now=now) == 1
        assert Redrive.objects.get(pk=one.pk).state == RedriveState.DROPPED

    def test_nothing_begins_while_a_live_worker_has_another_engine(self, race, site, now):
        start_worker(name="old", queues=["celery"], processes=1, now=now)
        start_worker(name="films", queues=["videos"], processes=1, now=now)
        site(NEW)
        assert sweep_redrives(now=now + timedelta(seconds=30)) == 0
        assert fresh(race).next_engine == "" and not Redrive.objects.exists()
        start_worker(name="old", queues=["celery"], processes=1, now=now)
        assert sweep_redrives(now=now + timedelta(seconds=30)) == 3


class TestInterruptions:
    @pytest.mark.parametrize("step", ["work_out_standings", "_standings"])
    def test_a_switch_that_breaks_off_has_not_happened_and_the_next_sweep_does_it(
        self, upgraded, monkeypatch, now, step
    ):
        again(upgraded, now, 9_000, 9_100, 9_200)
        before = everything(upgraded)
        with monkeypatch.context() as killed:
            killed.setattr(redrives, step, lambda *args: 1 / 0)
            sweep_redrives(now=now)
        assert everything(upgraded) == before and not Retiming.objects.exists()
        assert Redrive.objects.filter(state=RedriveState.PENDING).count() == 3
        sweep_redrives(now=now)
        assert shown(upgraded)[0] == ("ann", 9_000)
        sweep_redrives(now=now)
        assert Retiming.objects.count() == 3

    def test_queueing_that_breaks_off_has_queued_nothing(self, race, site, monkeypatch, now):
        site(NEW)
        with monkeypatch.context() as killed:
            killed.setattr(redrives.Redrive.objects, "bulk_create", lambda *args, **options: 1 / 0)
            assert sweep_redrives(now=now) == 0
        assert fresh(race).next_engine == "" and Evaluation.objects.count() == 3
        assert sweep_redrives(now=now) == 3

    def test_one_race_that_fails_does_not_keep_the_others_waiting(self, race, cast, site, monkeypatch, now):
        other = a_race(now, closes_at=now + timedelta(days=8))
        drive(other, cast[0], laps(9_000, 9_000, 9_000), now)
        site(NEW)
        real = redrives.hold_above
        monkeypatch.setattr(redrives, "hold_above", lambda one: 1 / 0 if one == race else real(one))
        assert sweep_redrives(now=now) == 1


class TestDuels:
    def test_a_draw_waits_until_the_qualifying_is_of_the_engine_that_drives_the_heats(self, cast, site, now):
        race = a_duel_race(now)
        qualify(race, cast, now)
        site(NEW)
        with pytest.raises(UserFault) as refused:
            draw_duels(race=race, now=race.closes_at)
        assert refused.value.code == "duels_wait_for_qualifying"
        assert drive_all_on(now=race.closes_at) == 0
        assert sweep_redrives(now=race.closes_at) == 3
        assert drive_all_on(now=race.closes_at) == 0
        again(race, race.closes_at, 10_300, 10_200, 10_100)
        sweep_redrives(now=race.closes_at)
        assert drive_all_on(now=race.closes_at) > 0
        assert list(Entry.objects.order_by("seed").values_list("racer__alias", flat=True)) == ["cat", "bob", "ann"]

    @pytest.mark.parametrize("duel_format", ["round_robin", "bracket"])
    def test_heats_under_way_are_undone_and_drawn_anew(self, cast, site, now, commits, duel_format):
        race = a_duel_race(now, duel_format=duel_format)
        qualify(race, cast, now)
        draw_duels(race=race, now=race.closes_at)
        drive_on(race=race, now=race.closes_at)
        heats = driving(race)
        end_heat(heats[0], race.closes_at)
        site(NEW)
        under_way = [one.evaluation_id for one in driving(race)]
        assert under_way
        assert sweep_redrives(now=race.closes_at) == 3
        assert not Draw.objects.exists() and not Duel.objects.exists()
        assert shown(race) == [("ann", 10_000), ("bob", 10_100), ("cat", 10_200)]
        assert set(Evaluation.objects.filter(pk__in=under_way).values_list("state", flat=True)) == {"stopped"}
        again(race, race.closes_at, 10_300, 10_200, 10_100)
        drive_all_on(now=race.closes_at)
        end_all(race, race.closes_at)
        assert Draw.objects.get().over_at is not None
        assert ranking(race) == ["cat", "bob", "ann"]
        assert set(Duel.objects.exclude(evaluation=None).values_list("evaluation__result__engine", flat=True)) == {NEW}
        assert sweep_redrives(now=race.closes_at) == 0

    def test_a_heat_that_another_engine_drove_does_not_count(self, cast, site, now, commits):
        race = a_duel_race(now)
        qualify(race, cast[:2], now)
        draw_duels(race=race, now=race.closes_at)
        drive_on(race=race, now=race.closes_at)
        (heat, *_) = driving(race)
        site(NEW)
        end_heat(heat, race.closes_at)
        heat.refresh_from_db()
        assert (heat.state, heat.tries) == (DuelState.WAITING, 0)
        assert drive_on(race=race, now=race.closes_at) == 0
        assert sweep_redrives(now=race.closes_at) == 2

    def test_duels_that_are_over_keep_their_engine(self, cast, site, now, commits):
        race = a_duel_race(now)
        qualify(race, cast, now)
        drive_all_on(now=race.closes_at)
        end_all(race, race.closes_at)
        before = everything(race)
        site(NEW)
        assert sweep_redrives(now=race.closes_at) == 0
        assert everything(race) == before


def test_a_change_that_changes_nothing_cannot_be_written_down(race, now):
    entry = Entry.objects.filter(race=race).first()
    for scores in ({"old_score_ms": 5, "new_score_ms": 5}, {}):
        with pytest.raises(IntegrityError), transaction.atomic():
            Retiming.objects.create(entry=entry, at=now, old_engine=OLD, new_engine=NEW, **scores)

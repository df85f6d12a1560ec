"""What comes in while a race is driven again, and races that are over."""

from __future__ import annotations

import pytest

from paddock.errors import UserFault
from races.boards.selectors.results import result_of
from races.entries.services.redrives import drive_again, sweep_redrives
from races.entries.services.submissions import repeat_submission, submit_model
from races.models import Entry, Redrive, Retiming, Submission
from races.pages.services import cancel_race
from tests.factories import a_model, a_racer, drive, fail, finish, laps
from tests.redrives import end, everything, pending, shown

from .site import MINUTE, NEW, OLD, OURS, again, fresh

pytestmark = pytest.mark.django_db


class TestCarsSentMeanwhile:
    def test_results_are_held_back_until_all_count_together(self, upgraded, cast, now):
        race = upgraded
        before = shown(race)
        held = drive(race, cast[2], laps(7_000, 7_000, 7_000), now)
        newcomer = drive(race, a_racer("dan"), laps(9_500, 9_500, 9_500), now)
        assert shown(race) == [*before, ("dan", None)]
        assert result_of(held, held.evaluation.result.laps, with_earlier=True).is_held
        assert fresh(race).fastest_lap_ms == 10_000
        again(race, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        assert shown(race) == [("cat", 7_000), ("ann", 9_000), ("bob", 9_100), ("dan", 9_500)]
        assert not result_of(
            Submission.objects.get(pk=newcomer.pk), newcomer.evaluation.result.laps, with_earlier=True
        ).is_held
        assert Entry.objects.get(race=race, racer=cast[2]).submission_count == 2

    def test_a_result_that_precedes_the_sweep_starts_the_redrive(self, race, cast, site, now):
        before = shown(race)
        site(NEW)
        drive(race, cast[2], laps(7_000, 7_000, 7_000), now)
        assert (shown(race), fresh(race).next_engine) == (before, NEW)
        assert sweep_redrives(now=now) == 3

    def test_a_late_result_of_the_old_engine_is_held_back_and_redriven(self, upgraded, cast, site, now):
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


class TestFinishedRace:
    def test_a_finished_race_keeps_its_engine_and_board(self, race, site, now):
        site(NEW)
        before = everything(race)
        assert sweep_redrives(now=race.closes_at) == drive_again(race=race, now=race.closes_at) == 0
        assert everything(race) == before

    def test_a_race_closing_during_a_redrive_is_redriven_to_the_end(self, upgraded, now):
        race, closed = upgraded, upgraded.closes_at + MINUTE
        again(race, closed, 9_000, 9_100, 9_200)
        sweep_redrives(now=closed)
        assert (shown(race)[0], fresh(race).engine) == (("ann", 9_000), NEW)
        assert sweep_redrives(now=closed) == 0

    def test_a_car_queued_at_the_close_starts_a_redrive(self, race, cast, site, now):
        late = submit_model(race=race, racer=cast[2], model=a_model(cast[2]), now=now)
        site(NEW)
        assert sweep_redrives(now=race.closes_at) == 3
        finish(late, laps(7_000, 7_000, 7_000), race.closes_at)
        again(race, race.closes_at, 9_000, 9_100, 9_200)
        sweep_redrives(now=race.closes_at)
        assert shown(race)[0] == ("cat", 7_000)

    def test_a_finished_race_repeats_no_run_with_another_engine(self, race, cast, site, now):
        failed = submit_model(race=race, racer=cast[0], model=a_model(cast[0]), now=now)
        fail(failed, OURS, now)
        site(NEW)
        with pytest.raises(UserFault) as refused:
            repeat_submission(submission=failed, now=race.closes_at)
        assert refused.value.code == "race_engine_gone"
        assert {OLD, NEW} == set(refused.value.params.values())
        assert repeat_submission(submission=failed, now=now).number == 3

    def test_a_race_cancelled_during_a_redrive_stops_it(self, upgraded, now, commits):
        before = shown(upgraded)
        end(pending(upgraded)[0], laps(9_000, 9_000, 9_000), now)
        cancel_race(race=upgraded, reason="Rain.", now=now)
        assert sweep_redrives(now=now) == 0
        assert (shown(upgraded), fresh(upgraded).engine, fresh(upgraded).next_engine) == (before, OLD, "")
        assert set(Redrive.objects.values_list("state", "evaluation__state")) == {
            ("dropped", "finished"),
            ("dropped", "stopped"),
        }

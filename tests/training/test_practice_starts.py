"""Every second car drives where cars have failed of late."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.simulator.rewards import follow_centre_line
from tests.paddock.simulator.tracks_for_tests import stadium
from tests.training.specs import a_spec
from training.trainer.network import NetworkLayout
from training.trainer.practice_starts import ASIDE, BEFORE_M, DRILL_STEPS, TURN_DEG, Drills, astray
from training.trainer.spec import TrainerSpec

SHORT, LONG = stadium(1.5), stadium(3.0)
LEFT, AHEAD = 4, 2  # of the default actions


def starts(drills: Drills, track, way: int = 0) -> list[float]:
    rng = np.random.default_rng(1)
    return [drills.start_m(way, track, rng) for _ in range(300)]


class TestPlaces:
    def test_a_drill_begins_aside_and_turned_to_either_side(self):
        rng = np.random.default_rng(4)
        found = np.array([astray(rng) for _ in range(500)])
        most = np.array([ASIDE, math.radians(TURN_DEG)])
        assert (np.abs(found) <= most).all() and (found.max(axis=0) > 0.95 * most).all()
        assert (found.min(axis=0) < -0.95 * most).all() and abs(np.corrcoef(found.T)[0, 1]) < 0.15

    def test_a_drill_begins_shortly_before_a_fault_also_across_the_finish_line(self):
        drills = Drills(2)
        assert drills.start_m(0, SHORT, np.random.default_rng(1)) is None
        drills.note(0, 1.0)
        before = [(1.0 - start) % SHORT.length for start in starts(drills, SHORT)]
        assert BEFORE_M[0] <= min(before) < 0.6 and 2.9 < max(before) <= BEFORE_M[1]
        assert drills.start_m(1, LONG, np.random.default_rng(1)) is None, "on another way nobody has failed"

    def test_a_drill_on_an_open_track_stays_on_it(self):
        drills, track = Drills(1), next(entry for entry in CATALOGUE if entry.is_open).geometry()
        drills.note(0, 0.2)
        drills.note(0, track.length)
        found = starts(drills, track)
        assert min(found) == 0.0 and max(found) <= track.length - 1.0 + 1e-9

    def test_the_latest_faults_count_and_those_without_exploring_count_four_times(self):
        drills = Drills(1)
        for _ in range(100):
            drills.note(0, 3.0)
        drills.note_looks([(0, 6.0)])
        near = np.array(starts(drills, LONG)) > 3.0
        assert 0.06 < near.mean() < 0.2  # an eighth
        for _ in range(32):
            drills.note(0, 6.0)
        assert min(starts(drills, LONG)) >= 3.0

    def test_places_go_through_a_checkpoint(self):
        drills, again = Drills(2), Drills(2)
        drills.note(0, 3.0)
        drills.note_looks([(1, 5.0)])
        again.note(0, 9.0)
        again.restore(drills.state())
        assert again.state() == drills.state() == [[3.0], [5.0] * 4]


@pytest.mark.xdist_group("training")
class TestCars:
    @pytest.fixture
    def cars(self):
        pytest.importorskip("torch", reason="training is not installed: make training")
        from training.trainer.cars import TrainingCars

        made = []

        def make(one: TrainerSpec, track=SHORT) -> TrainingCars:
            senses = list(NetworkLayout.of(one.metadata).senses)
            made.append(TrainingCars(one, track, [follow_centre_line] * 4, senses, 3))
            made[-1].reset()
            return made[-1]

        yield make
        for one in made:
            one.close()

    def test_drillers_begin_shortly_before_a_place_where_a_car_has_failed(self, cars):
        some, seen = cars(a_spec(SHORT)), 0
        for _ in range(120):
            (before,) = some.drills.state()
            some.step_async(np.full(4, LEFT))
            done = some.step_wait()[2]
            (places,) = some.drills.state()
            for number in np.flatnonzero(done & some._drillers & bool(before)):
                start = some.env.car(number).referee.odometer.place.distance
                assert any((place - start) % SHORT.length <= BEFORE_M[1] + 0.2 for place in places), (
                    "or where it turned"
                )
                seen += 1
        assert seen >= 3, "who only turns leaves the road"
        assert [one["episode"] for one in some.episodes] == list(range(len(some.episodes)))
        assert {one["status"] for one in some.episodes} == {"Off track"}

    def test_drillers_begin_astray_and_the_others_on_the_centre_line(self, cars):
        some = cars(a_spec(SHORT))
        some.drills.note(0, 1.0)
        aside, turned = [], []
        for _ in range(20):
            some.again(np.ones(4, np.bool_))
            for number in range(4):
                referee = some.env.car(number).referee
                place = SHORT.project(referee.pose.x, referee.pose.y)
                yaw = SHORT.point_at(place.distance)[2]
                apart = abs(place.offset), abs(math.remainder(referee.pose.yaw - yaw, math.tau))
                if number % 2:
                    aside.append(apart[0] / SHORT.width_at(0.0))
                    turned.append(math.degrees(apart[1]))
                else:
                    assert apart == pytest.approx((0.0, 0.0), abs=0.02)
                assert referee.all_wheels_on_track
        assert 0.2 < max(aside) < ASIDE + 0.01
        assert 18.0 < max(turned) < TURN_DEG + 1.0

    def test_drills_are_cut_after_four_seconds_and_not_written_down(self, cars, monkeypatch):
        monkeypatch.setattr("training.trainer.cars.astray", lambda rng: (0.0, 0.0))
        some, others = cars(a_spec(SHORT), stadium(24.0)), 0
        some.drills.note(0, 3.0)
        some.again(np.ones(4, np.bool_))
        for step in range(1, DRILL_STEPS + 1):
            some.step_async(np.full(4, AHEAD))
            _, _, done, infos = some.step_wait()
            assert done[1::2].tolist() == [step == DRILL_STEPS] * 2
            others += int(done[::2].sum())
        assert infos[1]["TimeLimit.truncated"] and infos[3]["TimeLimit.truncated"]
        assert len(some.episodes) == others

    def test_faults_are_kept_by_the_way_on_which_they_happened(self, cars):
        some = cars(a_spec(SHORT, more_tracks=[{"track": LONG.to_dict(), "look": "bold"}], alternate_direction=True))
        for _ in range(150):
            some.step_async(np.full(4, LEFT))
            some.step_wait()
        places = some.drills.state()
        assert len(places) == 4 and sum(map(bool, places)) >= 2
        assert max(max(one, default=0.0) for one in places[:2]) <= SHORT.length

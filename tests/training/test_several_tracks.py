"""Trainings on several tracks, in both directions, with a world that changes: what is asked, driven, judged, told."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from django.db import IntegrityError, transaction

from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.hyperparameters import PPO
from paddock.rules.training import DRIVEN_BY
from paddock.simulator.rewards import follow_centre_line
from tests.community import community
from tests.paddock.simulator.tracks_for_tests import stadium
from tests.rows import track_row
from tests.training.jobs import REWARD, a_training
from tests.training.specs import a_spec
from training.jobs.exports import logs_zip, metrics_json
from training.jobs.services.layout import layout_of
from training.jobs.services.worker import spec_of
from training.models import TrainingIteration, TrainingJob, TrainingTrack
from training.trainer.messages import _episode
from training.trainer.network import NetworkLayout
from training.wizard import all_round
from training.wizard.forms import INITIAL, TrainingForm
from training.wizard.prefill import proposals

SHORT, LONG = stadium(1.5), stadium(3.0)
SPEC = a_spec(SHORT, more_tracks=[{"track": LONG.to_dict(), "look": "bold"}], alternate_direction=True)


@pytest.fixture
def others(db) -> list:
    loops = [entry.slug for entry in CATALOGUE if entry.slug != "oval" and not entry.is_open]
    return [track_row(slug) for slug in loops[:8]]


@pytest.mark.django_db
@pytest.mark.usefixtures("training_wakes")
class TestAsked:
    def test_a_training_keeps_its_tracks_in_order_and_tells_the_trainer_of_them(self, alice, oval, others, now):
        job = a_training(
            alice, oval, now, more_tracks=others[:2], alternate_direction=True, direction="cw", random_light=50
        )
        assert job.tracks == [oval, *others[:2]]
        spec = spec_of(job)
        assert [len(one["track"]["centre"]) for one in spec.more_tracks] == [
            len(track.geometry.centre) for track in others[:2]
        ]
        assert spec.alternate_direction and spec.randomise == {"light": 0.5} and spec.ways == 6

    def test_a_training_on_one_track_is_told_as_before(self, alice, oval, now):
        spec = spec_of(a_training(alice, oval, now))
        assert (spec.more_tracks, spec.alternate_direction, spec.randomise) == ([], False, {})
        assert (spec.ways, spec.trials_driven, spec.updates_a_look) == (1, spec.trials, 1)

    @pytest.mark.parametrize("choose", [lambda oval, others: others, lambda oval, others: [oval]])
    def test_too_many_tracks_and_one_twice_are_refused(self, alice, oval, others, now, choose):
        with pytest.raises(UserFault) as refused:
            a_training(alice, oval, now, more_tracks=choose(oval, others))
        assert refused.value.code == "training_tracks" and not TrainingJob.objects.exists()

    def test_bots_on_a_second_track_that_is_open_are_refused(self, alice, oval, now):
        straight = track_row("straight-track")
        with pytest.raises(UserFault) as refused:
            a_training(alice, oval, now, more_tracks=[straight], race_type="head_to_head", bots=2)
        assert refused.value.code == "track_needs_loop"

    @pytest.mark.parametrize(("name", "value"), [("random_light", 101), ("random_start", -1), ("random_latency", 0.5)])
    def test_a_strength_out_of_range_is_refused(self, alice, oval, now, name, value):
        with pytest.raises(UserFault) as refused:
            a_training(alice, oval, now, **{name: value})
        assert refused.value.code == "training_randomisation" and refused.value.params["name"] == name

    def test_the_database_refuses_a_ninth_track_and_one_twice(self, alice, oval, others, now):
        job = a_training(alice, oval, now, more_tracks=others[:1])
        for place, track in ((8, others[1]), (0, others[1]), (2, others[0]), (1, others[1])):
            with pytest.raises(IntegrityError), transaction.atomic():
                TrainingTrack.objects.create(job=job, track=track, place=place)

    def test_the_wizard_takes_them_over(self, alice, oval, others, now):
        job = a_training(alice, oval, now, more_tracks=others[:2], alternate_direction=True, random_sensors=30)
        initial = proposals(alice, {"job": job.public_id})
        assert initial["more_tracks"] == [one.slug for one in others[:2]]
        assert initial["alternate_direction"] and initial["random_sensors"] == 30

    def test_the_wizard_proposes_an_all_round_car_on_tracks_that_there_are(self, alice, oval, now):
        slugs = all_round.TRACKS[1:3]
        for slug in slugs:
            track_row(slug)
        initial = proposals(alice, {"recipe": "all-round"})
        assert (initial["track"], initial["more_tracks"]) == ("oval", list(slugs))
        assert initial["alternate_direction"] and initial["stop_minutes"] == 15

    def test_the_form_reads_ticks_and_strengths(self, alice, oval, others, now):
        sent = {name: value for name, value in INITIAL.items() if name != "actions"}
        sent |= {"name": "all-round", "reward_code": REWARD, "track": oval.slug, "algorithm": PPO}
        sent |= {f"actions-{n}-steering": str(10 * n - 20) for n in (1, 2, 3)}
        sent |= {f"actions-{n}-speed": "1" for n in (1, 2, 3)}
        sent |= {"more_tracks": [oval.slug, others[0].slug], "alternate_direction": "on"}
        sent |= {"random_light-on": "on", "random_light": "70", "random_start": "70", "random_latency-on": "on"}
        sent["random_latency"] = "200"
        form = TrainingForm(sent, owner=alice, now=now)
        assert not form.is_valid() and list(form.errors) == ["random_latency"]
        form = TrainingForm({**sent, "random_latency": "20"}, owner=alice, now=now)
        assert form.is_valid(), form.errors
        said = form.values()
        assert said["more_tracks"] == [others[0]] and said["alternate_direction"] is True
        assert [said[name] for name in ("random_light", "random_start", "random_latency")] == [70, 0, 20]

    def test_the_form_reads_lane_changes_and_standing_laps(self, alice, oval, now):
        sent = {name: value for name, value in INITIAL.items() if name != "actions"}
        sent |= {"name": "in-traffic", "reward_code": REWARD, "track": oval.slug, "algorithm": PPO}
        sent |= {f"actions-{n}-steering": str(10 * n - 20) for n in (1, 2, 3)}
        sent |= {f"actions-{n}-speed": "1" for n in (1, 2, 3)}
        sent |= {"race_type": "head_to_head", "bots": "2", "standing_laps": "on", "bot_lane_changes": "on"}
        sent |= {"bot_lane_change_least_ms": "1.5", "bot_lane_change_most_ms": "2", "bot_lane_change_m": "2"}
        form = TrainingForm(sent, owner=alice, now=now)
        assert form.is_valid(), form.errors
        job = a_training(alice, oval, now, **{name: form.values()[name] for name in DRIVEN_BY if name != "boxes"})
        assert layout_of(job) == {
            **{"bots": 2, "bot_speed_mps": 1.0, "bot_lane_changes": True, "bot_lane_change_m": 2.0},
            **{"bot_lane_change_least_ms": 1500, "bot_lane_change_most_ms": 2000, "standing_laps": True},
        }
        assert layout_of(a_training(alice, oval, now, name="alone")) == {}

    def test_times_that_cannot_be_are_refused(self, alice, oval, now):
        with pytest.raises(UserFault) as caught:
            a_training(alice, oval, now, race_type="head_to_head", bots=1, bot_lane_change_least_ms=9000)
        assert caught.value.code == "training_course"

    def test_the_form_says_how_many_tracks_there_may_be(self, alice, oval, others, now):
        sent = {"name": "all-round", "track": oval.slug, "more_tracks": [one.slug for one in others]}
        assert "more_tracks" in TrainingForm(sent, owner=alice, now=now).errors


class TestJudged:
    @pytest.fixture(scope="class")
    @classmethod
    def judging(cls):
        pytest.importorskip("stable_baselines3", reason="training is not installed: make training")
        from training.trainer import policy_evaluation as judging

        return judging

    @pytest.fixture(scope="class")
    @classmethod
    def told(cls, judging):
        """What a car that always steers hard to the right comes to."""
        spec = replace(SPEC, stop_clean_laps=1)
        judge = judging.Judge(
            spec, SHORT, [follow_centre_line] * spec.trials_driven, list(NetworkLayout.of(spec.metadata).senses)
        )
        actions = len(spec.metadata["action_space"])
        verdict = judge.look(lambda rows: np.tile(np.eye(1, actions), (len(rows), 1)))
        judge.close()
        return verdict

    def test_each_way_has_a_trial(self, told):
        ways = [(trial["track"], trial["direction"]) for trial in told.trials]
        assert ways == [(0, "ccw"), (0, "cw"), (1, "ccw"), (1, "cw")]
        assert not told.confirmed

    def test_laps_on_several_tracks_count_by_the_metre(self, judging):
        def judged(*laps):
            trials = [{"lap_ms": lap, "progress": 100.0 if lap else 50.0, "reward": 1.0} for lap in laps]
            return judging.Judgement(trials, [], False, (10.0, 30.0)).key("lap_time")

        assert judged(10_000, 24_000) > judged(10_000, 27_000)
        assert judged(None, 24_000) > judged(10_000, None), "0.8 s a metre against 1 s: by the mean lap it were slower"

    def test_trials_are_looked_at_as_seldom_as_they_are_many(self):
        assert (SPEC.trials_driven, SPEC.updates_a_look) == (4, 2)
        assert replace(SPEC, trials=10).updates_a_look == 1

    def test_laps_in_a_row_are_driven_as_asked(self, judging):
        spec = replace(SPEC, stop_clean_laps=3, layout={"standing_laps": True})
        senses = list(NetworkLayout.of(spec.metadata).senses)
        judge = judging.Judge(spec, SHORT, [follow_centre_line] * spec.trials_driven, senses)
        rules = [drive._setting.rules for drive in judge._drives]
        assert [each.laps for each in rules] == [3, 3, 3, 3] and all(each.standing_laps for each in rules)
        judge.close()


def test_a_training_looks_at_each_of_its_ways():
    pytest.importorskip("torch", reason="training is not installed: make training")
    from training.trainer.client import Listener, train

    class Heard(Listener):
        def __init__(self):
            self.trials = []

        def iteration(self, iteration):
            self.trials = iteration.values["eval_trials"]

    heard = Heard()
    ended = train(replace(SPEC, trials=1, stop_steps=320), heard)
    assert ended.why == "steps"
    ways = [(one["track"], one["direction"]) for one in heard.trials]
    assert ways == [(0, "ccw"), (0, "cw"), (1, "ccw"), (1, "cw")]


def test_training_cars_drive_all_ways_and_say_which():
    pytest.importorskip("torch", reason="training is not installed: make training")
    from training.trainer.cars import TrainingCars

    cars = TrainingCars(SPEC, SHORT, [follow_centre_line] * 8, list(NetworkLayout.of(SPEC.metadata).senses), 3)
    cars.reset()
    for _ in range(60):
        cars.step_async(np.zeros(8, np.int64))
        cars.step_wait()
    episodes, _ = cars.harvest()
    cars.close()
    assert {(one["track"], one["direction"]) for one in episodes} == {(n, way) for n in (0, 1) for way in ("ccw", "cw")}


def test_what_the_process_says_of_a_way_is_held_within_bounds():
    said = {"reward": 1.0, "progress": 5.0, "status": "Off track", "steps": 9, "time_ms": 600}
    assert "track" not in _episode(said)
    assert _episode({**said, "track": 99, "direction": "up"}) == {**said, "track": 7, "direction": "ccw"}
    with pytest.raises(ValueError, match="whole"):
        _episode({**said, "track": "oval", "direction": "cw"})


@pytest.mark.django_db
@pytest.mark.usefixtures("training_wakes")
class TestFiles:
    @pytest.fixture
    def job(self, alice, oval, others, now):
        job = a_training(alice, oval, now, more_tracks=others[:1])
        one = {"reward": 1.5, "progress": 20.0, "status": "Off track", "steps": 30, "time_ms": 2000}
        episodes = [{**one, "episode": n, "track": n % 2, "direction": "ccw"} for n in range(3)]
        TrainingIteration.objects.create(
            job=job, number=1, steps=1, seconds=1.0, episodes=episodes, eval_trials=episodes, eval_progress=20.0,
            eval_reward=1.5,
        )  # fmt: skip
        return job

    def test_metrics_say_the_track_and_deepracer_utils_reads_them(self, job, tmp_path, monkeypatch):
        monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        path = tmp_path / "training-metrics.json"
        path.write_bytes(b"".join(metrics_json(job)))
        slugs = [track.slug for track in job.tracks]
        assert [one["track"] for one in json.loads(path.read_text())["metrics"]][:3] == [*slugs, "oval"]
        table = community().metrics.TrainingMetrics("no-bucket", fname=str(path))
        assert len(table.getTraining()) == 3 and len(table.getEvaluation()) == 3

    def test_the_zip_says_the_track_of_each_episode_of_the_traces(self, job):
        with zipfile.ZipFile(io.BytesIO(b"".join(logs_zip(job)))) as archive:
            said = archive.read("sim-trace/training/episodes.csv").decode().splitlines()
        other = job.tracks[1].slug
        assert said == ["iteration,episode,track,direction", "0,0,oval,ccw", f"0,1,{other},ccw", "0,2,oval,ccw"]

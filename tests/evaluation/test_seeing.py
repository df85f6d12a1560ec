"""What a car saw is drawn again from its trace: the very frames, and the answers that made the very actions."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest
from django.core.cache import cache
from django.urls import reverse
from django.utils import timezone
from onnx import helper, numpy_helper
from PIL import Image

from evaluation.camera_replay import replay as seeing
from evaluation.camera_replay.occlusion import camera_of, covered, heat, heat_picture
from evaluation.camera_replay.replay import answered, probabilities, seen_run
from evaluation.camera_replay.sensor_pictures import ZOOM
from evaluation.garage.services import share_model
from evaluation.running.queue.jobs import finish_evaluation
from league.house_cars.services import house_cars
from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.network.session import load
from paddock.packages.gate import check_onnx
from paddock.packages.metadata import parse_metadata
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.deciding import Policy
from paddock.simulator.race import Entrant, RaceResult, RaceSettings, run_race
from paddock.simulator.retracing import RunSight, TracePath, standing_boxes
from paddock.simulator.sensors import policy_header
from paddock.simulator.stage import PreparedTrack
from races.entries.services.submissions import submit_model
from tests.clients import logged_in
from tests.factories import a_race, a_racer, outcome, start
from tests.rows import model_row

CARS = house_cars()
BOXES = RaceRules(race_type="object_avoidance", random_boxes=6, seed=3, laps=1)
DUEL = RaceRules(race_type="head_to_head", laps=1)
ALONE = RaceRules(laps=1)


class Recorder:
    """A house car's network; ``frames``: all that it was shown."""

    def __init__(self, number: int) -> None:
        self.metadata = json.loads(CARS[number].metadata.read_bytes())
        self._session = onnxruntime.InferenceSession(CARS[number].onnx)
        self.frames: list[np.ndarray] = []

    def __call__(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        (frame,) = readings.values()
        self.frames.append(frame.copy())
        (node,) = self._session.get_inputs()
        channels_first = node.shape[1] == frame.shape[2]
        feed = (frame.transpose(2, 0, 1) if channels_first else frame)[None].astype(np.float32)
        return self._session.run(None, {node.name: feed})[0].reshape(-1)

    def entrant(self) -> Entrant:
        return Entrant(ActionSpace.from_metadata(self.metadata), sorted(self.metadata["sensor"]), self)


def driven(rules: RaceRules, cars: int) -> tuple[PreparedTrack, list[Recorder], RaceResult]:
    ground = PreparedTrack(by_slug("oval").geometry(), rules.direction)
    recorders = [Recorder(number) for number in range(cars)]
    cars = [recorder.entrant() for recorder in recorders]
    result = run_race(RaceSettings(ground.track, rules, cars, ground=ground))
    return ground, recorders, result


@pytest.mark.parametrize(("rules", "cars"), [(BOXES, 1), (DUEL, 3)], ids=["boxes", "three cars"])
def test_every_frame_of_a_run_is_found_again_to_the_bit(rules, cars):
    ground, recorders, result = driven(rules, cars)
    kept = json.loads(json.dumps(result.layout))["boxes"]  # places to a millimetre, as results keep them
    paths = [TracePath.of(run.trace.to_csv()) for run in (result, *result.rivals)]
    for number, recorder in enumerate(recorders):
        others = [path for other, path in enumerate(paths) if other != number]
        sight = RunSight(paths[number], standing_boxes(ground.track, rules, kept), (), others)
        asked = [step for step, was in enumerate(paths[number].asked) if was]
        assert len(asked) == len(recorder.frames) > 100
        readings = ground.readings(sorted(recorder.metadata["sensor"]))
        for step, frame in zip(asked, recorder.frames, strict=True):
            (again,) = sight.readings(step, readings).values()
            assert (again == frame).all(), (number, step)
    if cars > 1:  # and somebody was in sight
        alone = RunSight(paths[2])
        readings = ground.readings(sorted(recorders[2].metadata["sensor"]))
        (empty,) = alone.readings(0, readings).values()
        assert (empty != recorders[2].frames[0]).any()


def test_boxes_that_this_engine_would_put_elsewhere_stand_where_they_stood():
    track = by_slug("oval").geometry()
    recorded = [{"x": 1.0, "y": 2.0, "yaw": 0.5}]
    assert [box[:3] for box in standing_boxes(track, BOXES, recorded)] == [(1.0, 2.0, 0.5)]


@pytest.mark.parametrize("values", [[0.1, 0.7, 0.2], [3.0, -1.0, 0.5], [-800.0, 0.0, 900.0]])
def test_probabilities_are_shares_of_one(values):
    shares = probabilities(values)
    assert sum(shares) == pytest.approx(1.0) and int(np.argmax(shares)) == int(np.argmax(values))
    if sum(values) == pytest.approx(1.0):
        assert shares == pytest.approx(values)


@pytest.fixture
def run(db, wakes, monkeypatch, tmp_path):
    """A lap of a house car's network that Bob drove in an open race: the row, and the frames."""
    monkeypatch.setattr(seeing, "default_directory", lambda: tmp_path)
    cache.clear()
    now = timezone.now()
    _, (recorder,), result = driven(ALONE, 1)
    bob = a_racer("bob")
    model = model_row(bob, name="Real", onnx=CARS[0].onnx.read_bytes())
    type(model).objects.filter(pk=model.pk).update(metadata=recorder.metadata)
    model.refresh_from_db()
    submission = submit_model(race=a_race(now, laps=1, minimum_laps=1), racer=bob, model=model, now=now)
    evaluation = start(submission.evaluation, now)
    told = outcome([lap.to_dict() for lap in result.laps])
    told = replace(told, trace_csv=result.trace.to_csv(), trace_sha256=result.trace.sha256, layout=result.layout)
    assert finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=told, now=now)
    evaluation.refresh_from_db()
    return evaluation, recorder


def test_the_network_answers_again_what_it_drove_by(run, monkeypatch):
    evaluation, recorder = run
    seen = seen_run(evaluation)
    told = seen.answers(1, racer_pk=1)
    assert len(told) == len(recorder.frames)
    for step, values in told.items():
        moment = seen.moment(step)
        assert moment.asked and int(np.argmax(values)) == moment.index
    monkeypatch.setattr(seeing, "answered", None)  # nobody is asked a second time
    assert seen.answers(1, racer_pk=1) == told


def test_everybody_sees_the_frame_and_who_may_use_the_model_its_answers(run):
    evaluation, recorder = run
    frame, page = (reverse(name, args=[evaluation.public_id]) for name in ("evaluation_seen", "evaluation_saw"))
    cast = {
        "owner": evaluation.owner,
        "staff": a_racer("stella", is_staff=True),
        "stranger": a_racer("charlie"),
        "guest": None,
    }
    for name, racer in cast.items():
        client = logged_in(racer)
        answer = client.get(f"{frame}?lap=1&ms=2000")
        assert answer["Content-Type"] == "image/png" and len(answer.content) < 40_000
        pixels = np.array(Image.open(io.BytesIO(answer.content)))[::ZOOM, ::ZOOM]
        assert (pixels == recorder.frames[30][:, :, 0]).all()  # two seconds of fifteen steps
        assert client.get(f"{frame}?lap=1&ms=2000", headers={"if-none-match": answer["ETag"]}).status_code == 304
        shown = client.get(f"{page}?step=30")
        assert len(shown.context["bars"]) == (
            len(recorder.metadata["action_space"]) if name in ("owner", "staff") else 0
        )
    bars = logged_in(evaluation.owner).get(f"{page}?step=30").context["bars"]
    assert sum(bar.share for bar in bars) == pytest.approx(100) and sum(bar.chosen for bar in bars) == 1
    share_model(model=evaluation.model, now=timezone.now())
    assert logged_in(cast["stranger"]).get(f"{page}?step=30").context["bars"]


def test_a_network_that_looks_at_one_place_is_found_to_look_there():
    frame = np.full((120, 160, 1), 90, np.uint8)
    frame[40:60, 100:120] = 250
    readings = {"FRONT_FACING_CAMERA": frame, "SECTOR_LIDAR": np.zeros(8, np.float32)}
    assert camera_of(readings) == "FRONT_FACING_CAMERA" and camera_of({"LIDAR": frame}) is None
    shares = []
    for shown in covered(readings, "FRONT_FACING_CAMERA"):
        lit = float(shown["FRONT_FACING_CAMERA"][40:60, 100:120].min() == 250)
        assert shown["SECTOR_LIDAR"] is readings["SECTOR_LIDAR"]
        shares.append([lit, 1 - lit])
    found = heat(shares, frame)
    assert found.shape == (120, 160) and found.max() == 1.0
    assert found[40:60, 100:120].min() == 1.0 and found[:30].max() == found[70:].max() == 0
    picture = np.array(Image.open(io.BytesIO(heat_picture(frame, found, 1)))).astype(int)
    redness = picture[:, :, 0] - picture[:, :, 2]
    assert redness[50, 110] > 100 and abs(redness[100, 20]) < 3
    still = np.array(Image.open(io.BytesIO(heat_picture(frame, heat([[1.0, 0.0]] * len(shares), frame), 1))))
    assert (still == frame).all()  # what nothing changes is nowhere looked at


def test_who_may_use_the_model_sees_where_its_network_looks(run, monkeypatch):
    evaluation, _ = run
    page, frame = (reverse(name, args=[evaluation.public_id]) for name in ("evaluation_saw", "evaluation_attention"))
    owner, stranger = logged_in(evaluation.owner), logged_in(a_racer("charlie"))
    assert f"{frame}?step=30&amp;car=0" in owner.get(f"{page}?step=30&where").content.decode()
    monkeypatch.setattr(seeing, "answered", None)  # the page has asked; the picture asks nobody again
    picture = np.array(Image.open(io.BytesIO(owner.get(f"{frame}?step=30&car=0").content)))[::ZOOM, ::ZOOM].astype(int)
    redness = picture[:, :, 0] - picture[:, :, 2]
    assert picture.shape == (120, 160, 3) and redness.max() > 60 > 5 > redness.min()
    for reader in (stranger, logged_in(None)):
        assert reader.get(f"{frame}?step=30&car=0").status_code == 404
        assert frame not in reader.get(f"{page}?step=30&where").content.decode()
    share_model(model=evaluation.model, now=timezone.now())
    assert stranger.get(f"{frame}?step=30&car=0").status_code == 200
    assert owner.get(f"{frame}?step=30&car=7").status_code == 404


def test_a_run_that_the_reader_may_not_see_shows_nothing(run):
    evaluation, _ = run
    type(evaluation).with_sealed.filter(pk=evaluation.pk).update(sealed=True)
    for name in ("evaluation_seen", "evaluation_saw", "evaluation_attention"):
        for racer in (None, evaluation.owner, a_racer(f"of-{name[-4:]}", is_staff=True)):
            assert logged_in(racer).get(reverse(name, args=[evaluation.public_id])).status_code == 404


def test_bad_moments_are_refused_or_cut(run):
    evaluation, _ = run
    seen, frame = seen_run(evaluation), reverse("evaluation_seen", args=[evaluation.public_id])
    with pytest.raises(UserFault) as refused:
        seen.at(0, 9)
    assert refused.value.code == "seen_lap"
    client = logged_in(None)
    assert client.get(f"{frame}?lap=9").status_code == client.get(f"{frame}?car=1").status_code == 404
    assert client.get(f"{frame}?car=x").status_code == 404
    last = client.get(f"{frame}?ms=99999999999").content
    assert client.get(f"{frame}?step=999999").content == last
    for nonsense in ("ms=-1", "ms=x", "step=1e3", "ms=" + "9" * 40):
        assert client.get(f"{frame}?{nonsense}").content == client.get(frame).content
    assert (
        "seen_lap"
        in client.get(reverse("evaluation_saw", args=[evaluation.public_id]) + "?lap=9", follow=True).content.decode()
    )


def test_who_asks_too_often_waits(run, monkeypatch):
    from races.runs.views import camera as seen

    monkeypatch.setitem(seen.RATES, "seen_frame", "2/m/key")
    frame, client = reverse("evaluation_seen", args=[run[0].public_id]), logged_in(None)
    assert [client.get(frame).status_code for _ in range(3)] == [200, 200, 429]


def stacked_car() -> bytes:
    """A house car's network behind a mean of three frames, the newest with the greatest share."""
    model = onnx.load_from_string(CARS[0].onnx.read_bytes())
    (port,), graph = model.graph.input, model.graph
    for node in graph.node:
        node.input[:] = ["mixed" if name == port.name else name for name in node.input]
    graph.initializer.append(numpy_helper.from_array(np.array([[[[0.1]], [[0.1]], [[0.8]]]], np.float32), "shares"))
    graph.node.insert(0, helper.make_node("Conv", [port.name, "shares"], ["mixed"]))
    port.type.tensor_type.shape.dim[1].dim_value = 3
    return model.SerializeToString()


def test_a_network_that_reads_several_frames_is_asked_with_those_before(db, wakes, monkeypatch, tmp_path):
    monkeypatch.setattr(seeing, "default_directory", lambda: tmp_path)
    cache.clear()
    now = timezone.now()
    metadata = parse_metadata(json.dumps({**json.loads(CARS[0].metadata.read_bytes()), "frame_stack": 3}).encode())
    car, said = check_onnx(stacked_car(), metadata), metadata.to_dict()
    ground, space = PreparedTrack(by_slug("oval").geometry(), "ccw"), ActionSpace.from_metadata(said)
    policy, answers = Policy(load(car.onnx), policy_header(said, space)), []

    def drive(readings: dict[str, np.ndarray]) -> np.ndarray:
        answers.append(policy.answer(readings))
        return answers[-1]

    rules = RaceRules(laps=2)
    result = run_race(RaceSettings(ground.track, rules, [Entrant(space, sorted(said["sensor"]), drive)], ground=ground))
    assert all(lap.complete for lap in result.laps)
    bob = a_racer("bob")
    model = model_row(bob, name="Stacked", onnx=car.onnx)
    type(model).objects.filter(pk=model.pk).update(metadata=said)
    model.refresh_from_db()
    submission = submit_model(race=a_race(now, laps=2, minimum_laps=2), racer=bob, model=model, now=now)
    evaluation = start(submission.evaluation, now)
    told = outcome([lap.to_dict() for lap in result.laps])
    told = replace(told, trace_csv=result.trace.to_csv(), trace_sha256=result.trace.sha256, layout=result.layout)
    assert finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=told, now=now)
    evaluation.refresh_from_db()
    seen = seen_run(evaluation)
    again = {**seen.answers(1, racer_pk=1), **seen.answers(2, racer_pk=1)}
    assert list(again) == [step for step in range(max(again) + 1) if seen.moment(step).asked]
    np.testing.assert_allclose(list(again.values()), answers, atol=2e-4)

    second = seen.start_of(2)
    step, rows = seen.at(second).step, []
    monkeypatch.setattr(seeing, "answered", lambda *a, **k: rows.extend(answered(*a, **k)) or rows)
    assert seen.attention(step, racer_pk=1)[:4] == b"\x89PNG"
    np.testing.assert_allclose(rows[2], answers[list(again).index(step)], rtol=1e-4)  # the frame as it is
    rows.clear()
    assert seen.attention(0, racer_pk=1)[:4] == b"\x89PNG"
    np.testing.assert_allclose(rows[2], answers[0], rtol=1e-4)  # nothing before the first

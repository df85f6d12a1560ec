"""Cars of the old console are trained on as they were built there: read, learned on, raced, and cloned once more."""

from __future__ import annotations

import io
import json
from functools import cache

import numpy as np
import onnxruntime
import pytest

from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.garage.services import share_model, upload_model
from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.packages.read import UploadPart
from paddock.rules.hyperparameters import DEFAULTS, PPO
from tests.shared import CONSOLE_CAR, needs_shared
from tests.training.jobs import REWARD, a_training
from tests.training.test_network import metadata, readings_for, weights_for
from training.jobs.services.worker import spec_of
from training.models import TrainingJob, Vehicle
from training.trainer.network import CONSOLE, OURS, NetworkLayout, build_of, from_onnx, to_onnx
from training.trainer.observations import look

SHALLOW, MIDDLE = "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW", "DEEP_CONVOLUTIONAL_NETWORK"


@cache
def console_car() -> AdmittedPackage:
    """The real car, read and converted."""
    with CONSOLE_CAR.open("rb") as file:
        return admit([UploadPart(CONSOLE_CAR.name, file)])


def parts_of(layout: NetworkLayout, described: dict) -> list[UploadPart]:
    onnx = to_onnx(layout, weights_for(layout), squash=False)
    return [
        UploadPart("model.onnx", io.BytesIO(onnx)),
        UploadPart("model_metadata.json", io.BytesIO(json.dumps(described).encode())),
    ]


class TestNetworkBuilds:
    @pytest.mark.parametrize("build", [OURS, CONSOLE])
    def test_the_number_of_weights_tells_the_build(self, build):
        assert build_of(metadata(), NetworkLayout.of(metadata(), build).parameters) == build

    def test_an_unknown_number_of_weights_is_no_known_build(self):
        assert build_of(metadata(), NetworkLayout.of(metadata()).parameters + 1) is None

    def test_deeper_console_networks_are_not_known(self):
        assert build_of(metadata(network=MIDDLE), 1_000_000) is None
        with pytest.raises(LookupError):
            NetworkLayout.of(metadata(network=MIDDLE), CONSOLE)

    def test_console_networks_with_a_lidar_are_not_known(self):
        with pytest.raises(LookupError):
            NetworkLayout.of(metadata(["FRONT_FACING_CAMERA", "LIDAR"]), CONSOLE)

    @pytest.mark.parametrize("sensors", [["FRONT_FACING_CAMERA"], ["STEREO_CAMERAS"]], ids="+".join)
    def test_a_console_network_comes_back_from_the_gate_unchanged(self, sensors, tmp_path):
        described = metadata(sensors)
        layout = NetworkLayout.of(described, CONSOLE)
        admitted = admit(parts_of(layout, described), slots_directory=tmp_path)
        assert build_of(described, admitted.parameters) == CONSOLE
        again = from_onnx(layout, admitted.onnx)
        for name, array in weights_for(layout).items():
            np.testing.assert_allclose(again[name], array, rtol=1e-5, atol=1e-8, err_msg=name)

    def test_a_console_network_is_told_apart_from_ours(self):
        ours, console = NetworkLayout.of(metadata()), NetworkLayout.of(metadata(), CONSOLE)
        for written, read in ((ours, console), (console, ours)):
            with pytest.raises(ValueError):
                from_onnx(read, to_onnx(written, weights_for(written), squash=False))

    def test_other_strides_make_another_network(self):
        import onnx

        layout = NetworkLayout.of(metadata(), CONSOLE)
        model = onnx.load_from_string(to_onnx(layout, weights_for(layout), squash=False))
        convolution = [node for node in model.graph.node if node.op_type == "Conv"][1]
        next(one for one in convolution.attribute if one.name == "strides").ints[:] = [2, 1]
        with pytest.raises(ValueError):
            from_onnx(layout, model.SerializeToString())

    def test_an_observation_row_holds_bytes_pixel_by_pixel(self):
        layout = NetworkLayout.of(metadata(["STEREO_CAMERAS"]), CONSOLE)
        readings = readings_for(layout, 2)
        rows = look(list(layout.senses), readings)
        assert (rows.dtype, rows.shape) == (np.uint8, (2, 2 * 120 * 160))
        assert (rows[1, 120 * 160 :].reshape(120, 160) == readings["STEREO_CAMERAS"][1, :, :, 1]).all()


@needs_shared
class TestTheRealCar:
    def test_it_has_the_consoles_build(self):
        car = console_car()
        assert build_of(car.metadata.to_dict(), car.parameters) == CONSOLE

    def test_it_answers_the_same_with_the_imported_weights(self):
        torch = pytest.importorskip("torch", reason="training is not installed: make training")
        from training.trainer.warm_up import make_torso

        car = console_car()
        layout = NetworkLayout.of(car.metadata.to_dict(), CONSOLE)
        weights = from_onnx(layout, car.onnx)
        torso, head = make_torso(layout), torch.nn.Linear(512, 12)
        layers = [*(layer for layer in torso.eyes[0] if hasattr(layer, "weight")), torso.dense, head]
        names = [*(f"FRONT_FACING_CAMERA.conv{number}" for number in range(3)), "dense", "head"]
        readings = readings_for(layout, 3)
        with torch.no_grad():
            for layer, name in zip(layers, names, strict=True):
                layer.weight.copy_(torch.from_numpy(weights[name]))
                layer.bias.copy_(torch.from_numpy(weights[f"{name}_bias"]))
            rows = torch.from_numpy(look(list(layout.senses), readings))
            learned = torch.softmax(head(torso(rows)), dim=1).numpy()
        session = onnxruntime.InferenceSession(car.onnx, providers=["CPUExecutionProvider"])
        for frame, answer in zip(readings["FRONT_FACING_CAMERA"], learned, strict=True):
            (raced,) = session.run(None, {"FRONT_FACING_CAMERA": frame[None]})
            np.testing.assert_allclose(raced[0], answer, atol=1e-5)

    @pytest.mark.django_db
    @pytest.mark.usefixtures("training_wakes")
    def test_its_owner_and_others_it_is_shared_with_may_clone_it(self, alice, bob, oval, now, settings):
        settings.TRAININGS_AT_ONCE = 2
        with CONSOLE_CAR.open("rb") as file:
            model = upload_model(owner=alice, files=[UploadPart(CONSOLE_CAR.name, file)], now=now).model
        share_model(model=model, now=now)
        space = model.metadata["action_space"]
        for racer in (alice, bob):
            job = a_training(racer, oval, now, clone_from=model, action_space=space)
            assert spec_of(job).build == CONSOLE
        deep = Vehicle.objects.create(owner=alice, name="D", neural_network=MIDDLE)
        with pytest.raises(UserFault) as refused:
            a_training(alice, oval, now, name="deep", clone_from=model, action_space=space, vehicle=deep)
        assert refused.value.code == "clone_network"
        assert TrainingJob.objects.count() == 2

    @pytest.mark.soak  # a clone that is trained on is in tests/training/test_run.py, of a car of ours
    @pytest.mark.xdist_group("training")
    def test_its_trained_clone_has_the_same_build(self, tmp_path):
        """It laps the oval after a short update, as it did before: the weights were taken over and not lost."""
        pytest.importorskip("torch", reason="training is not installed: make training")
        from training.trainer.client import WEIGHTS, Iteration, Listener, train
        from training.trainer.spec import TrainerSpec

        car = console_car()
        iterations: list[Iteration] = []

        class Kept(Listener):
            def iteration(self, iteration: Iteration) -> None:
                iterations.append(iteration)

        usual = {**DEFAULTS[PPO], "lr": 1e-5, "num_epochs": 3, "num_episodes_between_training": 5}
        spec = TrainerSpec(
            track=by_slug("oval").geometry().to_dict(),
            race_type="time_trial",
            metadata=car.metadata.to_dict(),
            algorithm=PPO,
            hyperparameters=usual,
            reward_code=REWARD,
            stop_seconds=300.0,
            stop_steps=512,
            trials=1,
            build=CONSOLE,
        )
        ended = train(spec, Kept(), start=WEIGHTS, blob=car.onnx)
        assert (ended.why, len(iterations)) == ("steps", 1)
        assert iterations[0].values["eval_progress"] == 100.0
        layout = NetworkLayout.of(spec.metadata, CONSOLE)
        before, after = from_onnx(layout, car.onnx), from_onnx(layout, iterations[0].onnx)
        moved = max(float(np.abs(after[name] - before[name]).max()) for name in before)
        assert 0.0 < moved < 0.01, "learned on, not begun anew"
        parts = [
            UploadPart("model.onnx", io.BytesIO(iterations[0].onnx)),
            UploadPart("model_metadata.json", io.BytesIO(json.dumps(spec.metadata).encode())),
        ]
        admitted = admit(parts, slots_directory=tmp_path)
        assert build_of(spec.metadata, admitted.parameters) == CONSOLE

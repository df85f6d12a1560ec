"""A network that reads several observations at once gets those of its run, and of no other."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.network.bound import NetworkFacts
from paddock.network.policy_wire import STEP, WAYS
from paddock.network.session import Refused, load
from paddock.packages.admission import admit_network
from paddock.packages.export import export_model
from paddock.packages.gate import check_onnx
from paddock.packages.inputs import MOST_FRAMES
from paddock.packages.kinds import EXPORTS, ONNX
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import ModelMetadata, parse_metadata
from paddock.packages.own import OwnCar
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.deciding import Policy
from paddock.simulator.envs import DEFAULT_METADATA
from paddock.simulator.envs.setting import time_trial
from paddock.simulator.own import drive
from paddock.simulator.sensors import policy_header

ACTIONS = len(DEFAULT_METADATA["action_space"])


def metadata(frames: object, *sensors: str) -> ModelMetadata:
    said = {**DEFAULT_METADATA, "sensor": list(sensors or ("FRONT_FACING_CAMERA",)), "frame_stack": frames}
    return parse_metadata(json.dumps(said).encode())


def network(car: ModelMetadata, channels_first: bool = True, dtype: int = TensorProto.FLOAT) -> bytes:
    """Random weights on every value of every input."""
    random, nodes, ports, weights, sums = np.random.default_rng(4), [], [], {}, []
    for spec in car.inputs:
        shape = spec.channels_first if channels_first else spec.channels_last
        kind = dtype if spec.is_picture else TensorProto.FLOAT
        ports.append(helper.make_tensor_value_info(spec.sensor, kind, shape))
        name, size = spec.sensor, int(np.prod(shape))
        weights[f"w{name}"] = (random.standard_normal((size, ACTIONS)) / size).astype(np.float32)
        nodes += [
            helper.make_node("Cast", [name], [f"c{name}"], to=TensorProto.FLOAT),
            helper.make_node("Flatten", [f"c{name}"], [f"f{name}"]),
            helper.make_node("MatMul", [f"f{name}", f"w{name}"], [f"s{name}"]),
        ]
        sums.append(f"s{name}")
    while len(sums) > 1:
        nodes.append(helper.make_node("Add", [sums.pop(), sums.pop()], [f"sum{len(sums)}"]))
        sums.append(f"sum{len(sums)}")
    output = helper.make_tensor_value_info(sums[0], TensorProto.FLOAT, [1, ACTIONS])
    stored = [numpy_helper.from_array(array, name) for name, array in weights.items()]
    graph = helper.make_graph(nodes, "stacked", ports, [output], stored)
    opset = helper.make_opsetid("", 17)
    model: onnx.ModelProto = helper.make_model(graph, opset_imports=[opset], ir_version=8)
    return model.SerializeToString()


def header_of(car: ModelMetadata) -> dict:
    return policy_header(car.to_dict(), ActionSpace.from_metadata(car.to_dict()))


def observations(car: ModelMetadata, count: int) -> list[dict[str, np.ndarray]]:
    random, one = np.random.default_rng(7), dataclasses.replace(car, frame_stack=1)
    return [
        {
            spec.sensor: random.integers(0, 256, spec.shape).astype(np.uint8)
            if spec.is_picture
            else random.random(spec.shape, np.float32)
            for spec in one.inputs
        }
        for _ in range(count)
    ]


def expected(car: ModelMetadata, onnx_bytes: bytes, seen: list[dict[str, np.ndarray]]) -> list[np.ndarray]:
    """The answers to the stack at each step, made as a list of frames: zeros before the first."""
    session, answers = load(onnx_bytes).session, []
    for step in range(len(seen)):
        feeds = {}
        for port in session.get_inputs():
            frames = [seen[at][port.name] if at >= 0 else 0 * seen[0][port.name] for at in range(step + 1)]
            frames = [0 * frames[0]] * car.frame_stack + frames
            whole = np.concatenate(frames[-car.frame_stack :], axis=-1)
            if whole.ndim == 3 and port.shape[1] == whole.shape[2]:
                whole = whole.transpose(2, 0, 1)
            feeds[port.name] = whole[np.newaxis].astype(np.uint8 if "uint8" in port.type else np.float32)
        answers.append(session.run(None, feeds)[0].reshape(-1))
    return answers


CARS = {
    "two frames": (2, ("FRONT_FACING_CAMERA",)),
    "four of a stereo pair": (4, ("STEREO_CAMERAS",)),
    "three with a lidar": (3, ("LEFT_CAMERA", "LIDAR")),
    "eight with sectors": (8, ("observation", "DISCRETIZED_SECTOR_LIDAR")),
}


@pytest.mark.parametrize("exact", [False, True], ids=["float32", "float64"])
@pytest.mark.parametrize("layout", ["channels first", "channels last", "bytes"])
@pytest.mark.parametrize("kind", CARS)
def test_a_network_reads_the_last_observations_of_its_run(kind, layout, exact):
    frames, sensors = CARS[kind]
    car = metadata(frames, *sensors)
    dtype = TensorProto.UINT8 if layout == "bytes" else TensorProto.FLOAT
    canonical = check_onnx(network(car, layout == "channels first", dtype), car)
    policy = Policy(load(canonical.onnx, NetworkFacts(bound=None if exact else 0.0)), header_of(car))
    seen = observations(car, 2 * frames)
    wanted = expected(car, canonical.onnx, seen)
    for shown, answer in zip(seen, wanted, strict=True):
        np.testing.assert_allclose(policy.answer(shown), answer, rtol=1e-4, atol=1e-6)
    assert not np.allclose(wanted[-1], expected(car, canonical.onnx, seen[-1:])[0], rtol=1e-3)


def test_the_first_step_of_a_run_begins_with_no_observation_before_it():
    car = metadata(4)
    policy = Policy(load(check_onnx(network(car), car).onnx), header_of(car))  # its bound is found out here

    def run(seen: list[dict[str, np.ndarray]]) -> list[list[float]]:
        answers = []
        for step, shown in enumerate(seen, start=1):
            STEP.pack_into(policy.request, 0, step)
            answers.append(policy.answer(shown).tolist())
        return answers

    first, second = observations(car, 6), observations(car, 9)[5:]
    told = run(first)
    assert run(second) != run(first) == told


def test_who_counts_no_steps_begins_without_observations_too():
    """Where the bound is not known, the network was asked about other pictures before."""
    car = metadata(3)
    onnx_bytes, seen = check_onnx(network(car), car).onnx, observations(car, 3)
    answers = [
        Policy(load(onnx_bytes, facts), header_of(car)).answer(seen[0]) for facts in (None, NetworkFacts(bound=0.0))
    ]
    np.testing.assert_allclose(*answers, rtol=1e-4, atol=1e-6)


def test_a_car_without_stacked_frames_is_who_it_was():
    plain = json.dumps({**DEFAULT_METADATA, "frame_stack": None}).encode()
    cars = [parse_metadata(plain), metadata(1), metadata("1")]
    assert {car.canonical_json() for car in cars} == {
        parse_metadata(json.dumps(DEFAULT_METADATA).encode()).canonical_json()
    }
    assert all("frame_stack" not in car.to_dict() and "frames" not in header_of(car) for car in cars)


def test_the_number_of_frames_belongs_to_who_a_car_is():
    car = metadata("4")
    assert (car.frame_stack, car.to_dict()["frame_stack"], header_of(car)["frames"]) == (4, 4, 4)
    again = parse_metadata(json.dumps(car.to_dict()).encode())
    assert again == car and car.canonical_json() != metadata(1).canonical_json()


@pytest.mark.parametrize("frames", [0, -1, MOST_FRAMES + 1, 2.5, True, "four", [4], 1e300])
def test_a_number_of_frames_that_cannot_be_is_refused(frames):
    with pytest.raises(UserFault) as fault:
        metadata(frames)
    assert (fault.value.code, fault.value.params) == ("metadata_frame_stack", {"limit": MOST_FRAMES})


@pytest.mark.parametrize(("of_network", "of_metadata"), [(4, 1), (4, 2), (1, 4)])
def test_a_network_of_another_number_of_frames_is_refused(of_network, of_metadata):
    with pytest.raises(UserFault) as fault:
        check_onnx(network(metadata(of_network)), metadata(of_metadata))
    assert fault.value.code == "onnx_input_shape"
    with pytest.raises(Refused):
        car = metadata(of_network)
        Policy(load(check_onnx(network(car), car).onnx), header_of(metadata(of_metadata)))


@pytest.mark.parametrize("form", EXPORTS)
def test_forms_for_programs_that_keep_no_frames_are_refused(form):
    car = metadata(2)
    canonical = check_onnx(network(car), car)
    with pytest.raises(UserFault) as fault:
        export_model(canonical.onnx, car, form)
    assert (fault.value.code, fault.value.params) == ("export_frame_stack", {"count": "2"})


def test_an_environment_shows_one_observation_at_a_time():
    for observation in ("dict", "box", "rgb"):
        setting = time_trial(metadata=metadata(4).to_dict(), observation=observation)
        shown = setting.observation_space
        assert (shown["FRONT_FACING_CAMERA"] if observation == "dict" else shown).shape == (
            (120, 160, 3) if observation == "rgb" else (120, 160, 1)
        )


def test_it_drives_at_home_twice_the_same():
    car = metadata(3)
    canonical = admit_network(ONNX, network(car), car, DEFAULT_LIMITS)
    own = OwnCar(canonical.onnx, car.to_dict(), canonical.facts.to_dict(), canonical.sha256)
    track, rules = by_slug("oval").geometry(), RaceRules(laps=1, max_simulated_ms=4_000)
    runs = [drive(track, rules, [own]) for _ in range(2)]
    assert runs[0].result.trace.sha256 == runs[1].result.trace.sha256
    assert len(runs[0].ways[0]) == len(WAYS) and sum(runs[0].ways[0]) > 20

"""Cars with every set of sensors, from the upload to the trace: read, converted or checked, and driven past boxes."""

from __future__ import annotations

import io
import json

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.running.pipeline import RaceJob, evaluate
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.network.session import load
from paddock.packages.inputs import CAMERAS, LIDARS, input_spec
from paddock.packages.read import UploadPart
from paddock.rules.race import BoxPlace, RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.deciding import Policy
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.sensors import sensor_spec
from tests.paddock.packages.coach import coach_graph, metadata_dict
from tests.pinned import pinned_process
from tests.sandbox.conftest import nothing_left  # noqa: F401
from tests.soak import only

pytestmark = pytest.mark.usefixtures("nothing_left")

ACTIONS = 5
SECONDS = [[], *([name] for name in LIDARS)]
SETS = [[camera, *lidar] for camera in CAMERAS for lidar in SECONDS]
EACH_ONCE = [[camera, *lidar] for camera, lidar in zip(CAMERAS, SECONDS, strict=True)]  # the others in `make soak`
RULES = RaceRules(
    race_type="object_avoidance",
    boxes=(BoxPlace(0.09, "inner"), BoxPlace(0.16, "outer"), BoxPlace(0.25, "inner")),
    max_simulated_ms=6000,
    collision_penalty_ms=1000,
)
LIDAR_CONFIG = {"num_sectors": 16, "num_values_per_sector": 3, "clipping_dist": 4.0}


@pytest.fixture(scope="module")
def oval():
    return next(track for track in CATALOGUE if track.slug == "oval").geometry()


def onnx_network(sensors: list[str], *, channels_first: bool = False, floats: bool = False) -> bytes:
    """Every input flattened, joined and multiplied by random weights; of a picture every 97th pixel counts."""
    rng = np.random.default_rng(7)
    inputs, nodes, weights, parts = [], [], {}, []
    for name in sorted(sensors):
        spec = input_spec(name, LIDAR_CONFIG)
        shape = spec.channels_first if channels_first else spec.channels_last
        kind = TensorProto.UINT8 if spec.is_picture and not floats else TensorProto.FLOAT
        inputs.append(helper.make_tensor_value_info(name, kind, shape))
        nodes += [
            helper.make_node("Cast", [name], [f"{name}_float"], to=TensorProto.FLOAT),
            helper.make_node("Flatten", [f"{name}_float"], [f"{name}_row"]),
            helper.make_node("MatMul", [f"{name}_row", f"{name}_weights"], [f"{name}_part"]),
        ]
        size = int(np.prod(spec.shape))
        layer = rng.standard_normal((size, ACTIONS)) * (0.002 if spec.is_picture else 1.0)
        if spec.is_picture:
            layer[np.arange(size) % 97 != 0] = 0.0
        weights[f"{name}_weights"] = layer.astype(np.float32)
        parts.append(f"{name}_part")
    nodes.append(helper.make_node("Sum", parts, ["scores"]))
    graph = helper.make_graph(
        nodes,
        "car",
        inputs,
        [helper.make_tensor_value_info("scores", TensorProto.FLOAT, [1, ACTIONS])],
        [numpy_helper.from_array(value, name) for name, value in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def metadata_of(sensors: list[str]) -> dict:
    return {**metadata_dict(sensors, actions=ACTIONS), "lidar_config": LIDAR_CONFIG}


def upload(network: bytes, name: str, metadata: dict) -> AdmittedPackage:
    files = {name: network, "model_metadata.json": json.dumps(metadata).encode()}
    return admit([UploadPart(path, io.BytesIO(content)) for path, content in files.items()])


@pytest.fixture(scope="module")
def pinned():
    with pinned_process() as process:
        yield process


def drive_here(track, package: AdmittedPackage) -> str:
    """The sha-256 of the trace when simulator and network run in this process, without pipes."""
    metadata = package.metadata.to_dict()
    config = metadata.get("lidar_config")
    space = ActionSpace.from_metadata(metadata)
    specs = [sensor_spec(name, config) for name in sorted(metadata["sensor"])]
    inputs = [{"name": spec.name, "dtype": spec.dtype, "shape": list(spec.shape)} for spec in specs]
    policy = Policy(load(package.onnx), {"inputs": inputs, "outputs": space.size, "ranges": space.ranges})

    return run_race(
        RaceSettings(track, RULES, [Entrant(space, metadata["sensor"], policy.answer, lidar_config=config)])
    ).trace.sha256


def drive(track, package: AdmittedPackage):
    return evaluate(RaceJob(track, RULES, package.onnx, package.metadata.to_dict()))


@pytest.mark.slow
@pytest.mark.parametrize("sensors", only(EACH_ONCE, SETS), ids="+".join)
def test_every_sensor_set_drives_from_onnx(sensors, oval, pinned):
    package = upload(onnx_network(sensors), "car.onnx", metadata_of(sensors))
    outcome = drive(oval, package)
    assert outcome.simulated_ms == 6000 and len(outcome.trace_csv.splitlines()) > 60
    assert outcome.trace_sha256 == pinned.submit(drive_here, oval, package).result()


@pytest.mark.slow
@pytest.mark.parametrize(
    "sensors",
    only([["STEREO_CAMERAS", "SECTOR_LIDAR"]],
         [["STEREO_CAMERAS"], ["LEFT_CAMERA", "LIDAR"], ["STEREO_CAMERAS", "SECTOR_LIDAR"],
          ["FRONT_FACING_CAMERA", "DISCRETIZED_SECTOR_LIDAR"]]),
    ids="+".join,
)  # fmt: skip
def test_every_sensor_set_drives_from_tensorflow(sensors, oval, pinned):
    metadata = {**metadata_dict(sensors, actions=ACTIONS)}  # the graph's lidar has the field's default configuration
    package = upload(coach_graph(sensors, actions=ACTIONS, middleware=[8]), "model.pb", metadata)
    assert package.source_kind == "tensorflow"
    outcome = drive(oval, package)
    assert outcome.simulated_ms == 6000
    assert outcome.trace_sha256 == pinned.submit(drive_here, oval, package).result()


@pytest.mark.slow
def test_input_layout_and_type_do_not_change_what_a_car_sees(oval):
    """Two channels, first or last, bytes or floats: the same numbers reach the network."""
    sensors = ["FRONT_FACING_CAMERA", "LIDAR"]
    traces = {
        drive(oval, upload(onnx_network(sensors, **form), "car.onnx", metadata_of(sensors))).trace_sha256
        for form in ({}, {"channels_first": True}, {"floats": True})
    }
    assert len(traces) == 1


def test_a_network_that_misfits_its_lidar_is_refused():
    sensors = ["FRONT_FACING_CAMERA", "DISCRETIZED_SECTOR_LIDAR"]
    metadata = metadata_of(sensors)
    metadata["lidar_config"] = {"num_sectors": 8, "num_values_per_sector": 8}
    with pytest.raises(UserFault) as fault:
        upload(onnx_network(sensors), "car.onnx", metadata)
    assert fault.value.code == "onnx_input_shape"
    assert fault.value.params["expected"] == "[1, 64]"


def test_a_network_ignoring_its_second_sensor_is_refused():
    with pytest.raises(UserFault) as fault:
        upload(onnx_network(["STEREO_CAMERAS"]), "car.onnx", metadata_of(["STEREO_CAMERAS", "LIDAR"]))
    assert fault.value.code == "onnx_inputs"

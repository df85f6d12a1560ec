"""Cars written for others: OpenVINO reads both forms and answers as the runtime, and we read ours as the same car."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import onnxruntime
import pytest

import paddock.simulator.envs  # noqa: F401  (registers them)
from paddock.errors import UserFault
from paddock.packages.admission import admit_network
from paddock.packages.export import export_model, openvino_ir
from paddock.packages.export.graphdef import MARK
from paddock.packages.gate import Canonical, check_onnx
from paddock.packages.kinds import CAR, OPENVINO
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import ModelMetadata, parse_metadata
from paddock.packages.read import UploadPart, read_upload
from paddock.packages.tensorflow import convert
from paddock.packages.tensorflow.graph import read_graph
from tests.paddock.simulator.tracks_for_tests import stadium
from tests.shared import CONSOLE_CAR, SHARED, needs_shared
from training.trainer.network import NetworkLayout, to_onnx

from .coach import DEEP, MEDIUM, SHALLOW, coach_graph, metadata_dict
from .test_console_car import picture
from .test_conversion import CASES, TRAINING_PARTS, WIDE, admit, read

PICTURES = ("dr-demo-1.png", "dr-demo-2.png", "dr-demo-3.png")
CAMERA = "FRONT_FACING_CAMERA"
# sensors, depth and head of what trainings make here
TRAINED = {
    "trained, discrete": ([CAMERA], SHALLOW, "discrete"),
    "trained, continuous": ([CAMERA], MEDIUM, "continuous"),
    "trained, sac": ([CAMERA], DEEP, "sac"),
    "trained, left camera": (["LEFT_CAMERA"], SHALLOW, "discrete"),
    "trained, stereo and lidar": (["STEREO_CAMERAS", "LIDAR"], SHALLOW, "sac"),
    "trained, sector lidar": ([CAMERA, "SECTOR_LIDAR"], DEEP, "discrete"),
    "trained, discretised lidar": (["LEFT_CAMERA", "DISCRETIZED_SECTOR_LIDAR"], MEDIUM, "continuous"),
}
HEAVY = {"shallow, discrete", "deep, discrete", "deep, continuous"}
KINDS = [*(kind for kind in CASES if kind not in HEAVY), "batch normalisation", "dropout", *TRAINED]


@cache
def car(kind: str) -> tuple[Canonical, ModelMetadata]:
    """A network of this kind with random weights, admitted."""
    if kind in TRAINED:
        sensors, depth, head = TRAINED[kind]
        said = metadata_dict(sensors, depth, head)
        layout, rng = NetworkLayout.of(said), np.random.default_rng(3)
        drawn = {
            name: rng.normal(0, 1, shape) / np.sqrt(max(1, np.prod(shape[1:]))) for name, shape in layout.shapes.items()
        }
        metadata = parse_metadata(json.dumps(said).encode())
        return check_onnx(to_onnx(layout, drawn, head != "discrete"), metadata), metadata
    arguments, options = CASES.get(kind) or (
        {"sensors": [CAMERA, "LIDAR"]},
        {"middleware": [32], **TRAINING_PARTS[kind]},
    )
    metadata = read(arguments)
    return admit(coach_graph(**arguments, **options), metadata), metadata


@cache
def readings(camera: str, lidar: str) -> list[dict[str, np.ndarray]]:
    """What the sensors of a car read on its way, two steps of it."""
    space = {"action_space": [{"steering_angle": 10, "speed": 1.0}], "sensor": [camera, *([lidar] if lidar else [])]}
    env = gymnasium.make("Paddock/ObjectAvoidance-v1", track=stadium(), random_boxes=3, metadata=space)
    env.reset(seed=2)
    return [env.step(0)[0] for _ in range(2)]


def feeds_of(metadata: ModelMetadata) -> list[dict[str, np.ndarray]]:
    """Readings with a batch of one; pictures as bytes, channels last."""
    (camera,) = [name for name in metadata.sensors if "LIDAR" not in name]
    lidar = next((name for name in metadata.sensors if "LIDAR" in name), "")
    seen = readings(CAMERA if camera == "observation" else camera, lidar)
    named = [
        {camera if name == CAMERA and camera == "observation" else name: one for name, one in step.items()}
        for step in seen
    ]
    return [{name: np.asarray(one)[np.newaxis] for name, one in step.items()} for step in named]


def runtimes(canonical: Canonical, metadata: ModelMetadata, feed: dict[str, np.ndarray]) -> np.ndarray:
    """The answer of the network that races here, as the field's policy node says it: see the head of ``policy``."""
    session = onnxruntime.InferenceSession(canonical.onnx, providers=["CPUExecutionProvider"])
    given = {}
    for name, dtype, shape in canonical.inputs:
        last = feed[name].ndim == 4 and shape != feed[name].shape
        given[name] = (feed[name].transpose(0, 3, 1, 2) if last else feed[name]).astype(dtype)
    answer = session.run(None, given)[0]
    soft = any(node.op == "Softmax" for node in _nodes(canonical))
    if metadata.action_space_type == "discrete" and not soft:
        powers = np.exp(answer - answer.max())
        answer = powers / powers.sum()
    return answer


def _nodes(canonical: Canonical) -> list[Any]:
    from paddock.network.canonical import CanonicalNetwork

    return CanonicalNetwork.read(canonical.onnx).nodes


@cache
def openvino_core() -> Any:
    """OpenVINO, started once."""
    return pytest.importorskip("openvino").Core()


def openvinos(path: Path, metadata: ModelMetadata, feeds: list[dict[str, np.ndarray]]) -> list[np.ndarray]:
    """What OpenVINO answers that reads a graph or a representation; of SAC after the tanh that cars take themselves."""
    core = openvino_core()
    model = core.read_model(str(path))
    sensors = {port: port.get_any_name().split(":")[0].rsplit("/", 1)[-1] for port in model.inputs}
    first = path.suffix == ".xml"
    if not first:
        model.reshape({port: list(feeds[0][name].shape) for port, name in sensors.items()})
    compiled = core.compile_model(model, "CPU", {"INFERENCE_PRECISION_HINT": "f32", "INFERENCE_NUM_THREADS": 1})
    answers = []
    for feed in feeds:
        values = [feed[name].astype(np.float32) for name in sensors.values()]
        turned = [one.transpose(0, 3, 1, 2) if first and one.ndim == 4 else one for one in values]
        answers.append(np.array(compiled(turned)[0]))
    return [np.tanh(answer) for answer in answers] if metadata.algorithm == "sac" else answers


def frozen_graph(onnx: bytes, metadata: ModelMetadata) -> bytes:
    with tarfile.open(fileobj=io.BytesIO(export_model(onnx, metadata, CAR))) as archive:
        return archive.extractfile("agent/model.pb").read()


def written(canonical: Canonical, metadata: ModelMetadata, form: str, folder: Path) -> Path:
    """The exported file that OpenVINO reads."""
    if form == CAR:
        (folder / "model.pb").write_bytes(frozen_graph(canonical.onnx, metadata))
        return folder / "model.pb"
    xml, numbers = openvino_ir(canonical.onnx, metadata)
    (folder / "model.xml").write_bytes(xml)
    (folder / "model.bin").write_bytes(numbers)
    return folder / "model.xml"


# Each network in one form or the other; all in both, and the heavy ones, in `make soak`
IN_TURN = [
    pytest.param(kind, form, marks=pytest.mark.soak if kind in HEAVY or (number + second) % 2 else ())
    for number, kind in enumerate([*KINDS, *sorted(HEAVY)])
    for second, form in enumerate((CAR, OPENVINO))
]


@pytest.mark.parametrize(("kind", "form"), IN_TURN)
def test_openvino_answers_as_the_runtime_does(kind: str, form: str, tmp_path: Path) -> None:
    canonical, metadata = car(kind)
    feeds = feeds_of(metadata)
    expected = [runtimes(canonical, metadata, feed) for feed in feeds]
    found = openvinos(written(canonical, metadata, form, tmp_path), metadata, feeds)
    assert np.ptp(np.concatenate(expected)) > 1e-3, "a network that always answers the same proves nothing"
    np.testing.assert_allclose(np.concatenate(found), np.concatenate(expected), atol=1e-5, rtol=0)


@pytest.mark.parametrize("kind", KINDS)
def test_an_exported_graph_is_read_as_the_very_same_network(kind: str) -> None:
    canonical, metadata = car(kind)
    again = convert(frozen_graph(canonical.onnx, metadata), metadata.inputs, WIDE)
    assert check_onnx(again, metadata, WIDE).sha256 == canonical.sha256


@needs_shared
@pytest.mark.parametrize("form", [CAR, OPENVINO])
def test_the_consoles_own_car_answers_its_pictures_as_before(form: str, tmp_path: Path) -> None:
    with CONSOLE_CAR.open("rb") as file:
        package = read_upload([UploadPart(CONSOLE_CAR.name, file)])
    metadata = parse_metadata(package.metadata_json)
    canonical = check_onnx(convert(package.model, metadata.inputs), metadata)
    feeds = [{CAMERA: picture(name)} for name in PICTURES]
    expected = [runtimes(canonical, metadata, feed) for feed in feeds]
    found = openvinos(written(canonical, metadata, form, tmp_path), metadata, feeds)
    np.testing.assert_allclose(np.concatenate(found), np.concatenate(expected), atol=1e-5, rtol=0)
    golden = json.loads((SHARED / "models" / "golden.json").read_text())["frames"]
    assert [int(one.argmax()) for one in found] == [golden[name]["action"] for name in PICTURES]


@pytest.mark.parametrize(
    ("kind", "inputs", "output"),
    [
        ("trained, discrete", {CAMERA: "main"}, "main_level/agent/main/online/network_1/ppo_head_0/policy"),
        (
            "trained, stereo and lidar",
            {"STEREO_CAMERAS": "policy", "LIDAR": "policy"},
            "main_level/agent/policy/online/network_0/sac_policy_head_0/policy",
        ),
    ],
)
def test_nodes_have_the_names_that_cars_look_for(kind: str, inputs: dict[str, str], output: str) -> None:
    canonical, metadata = car(kind)
    graph = read_graph(frozen_graph(canonical.onnx, metadata), DEFAULT_LIMITS)
    placeholders = {node.name for node in graph.nodes.values() if node.op == "Placeholder"}
    assert placeholders == {
        f"main_level/agent/{scope}/online/network_0/{name}/{name}" for name, scope in inputs.items()
    }
    assert [node.name for node in graph.sinks] == [output]
    xml, _ = openvino_ir(canonical.onnx, metadata)
    assert all(f'name="{name}"'.encode() in xml for name in (*placeholders, output))


def test_a_graph_takes_any_number_of_frames(tmp_path: Path) -> None:
    """As the console's, whose batch is open."""
    canonical, metadata = car("trained, discrete")
    path = written(canonical, metadata, CAR, tmp_path)
    single = feeds_of(metadata)
    together = {name: np.concatenate([feed[name] for feed in single]) for name in single[0]}
    (both,) = openvinos(path, metadata, [together])
    np.testing.assert_allclose(both, np.concatenate(openvinos(path, metadata, single)), atol=1e-6)


def without_its_mark(graph: bytes) -> bytes:
    """The same graph; its mark has another name of the same length."""
    assert graph.count(MARK.encode()) == 1
    return graph.replace(MARK.encode(), b"_someone")


@pytest.mark.parametrize("kind", ["shallow, sac", "medium, discrete", "batch normalisation", *TRAINED])
def test_without_its_mark_a_graph_is_converted_from_its_operations(kind: str) -> None:
    canonical, metadata = car(kind)
    graph = without_its_mark(frozen_graph(canonical.onnx, metadata))
    converted = check_onnx(convert(graph, metadata.inputs, WIDE), metadata, WIDE)
    for feed in feeds_of(metadata):
        expected, found = (runtimes(one, metadata, feed) for one in (canonical, converted))
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_a_mark_that_lies_is_not_believed() -> None:
    """It is the graph that counts, as whoever drives it elsewhere sees it."""
    canonical, metadata = car("trained, discrete")
    graph = frozen_graph(canonical.onnx, metadata)
    relu, tanh = b"\x12\x04Relu", b"\x12\x04Tanh"
    assert relu in graph
    lying = graph.replace(relu, tanh)
    found, honest = (check_onnx(convert(one, metadata.inputs), metadata) for one in (lying, without_its_mark(lying)))
    assert found.sha256 == honest.sha256 != canonical.sha256


@pytest.mark.parametrize(
    "damage", [b'{"form":9', b'["form",1', b'{"form":1,"sac":false,"scores":true,"weights":{"_w0":[1']
)
def test_a_damaged_mark_is_as_good_as_none(damage: bytes) -> None:
    canonical, metadata = car("trained, discrete")
    graph = bytearray(frozen_graph(canonical.onnx, metadata))
    at = graph.index(b'{"form":1')
    graph[at : at + len(damage)] = damage
    assert check_onnx(convert(bytes(graph), metadata.inputs), metadata).sha256 != canonical.sha256


@pytest.mark.parametrize(
    ("kind", "sha256"),
    [
        ("shallow, sac", "1a6cc52769db8e98f952620f540a039db7fb9274c51e816dcf56fa5c1cedd1fe"),
        ("trained, discrete", "ef3040d84a973f4e4c84e8ef62ce1a0ad3c3ccbd6a17d6defaee797a0123e237"),
    ],
)
def test_the_same_network_is_always_the_same_graph(kind: str, sha256: str) -> None:
    """What is written today must be known again by every later Paddock: whoever changes these bytes raises ``FORM``
    and keeps reading what the old one wrote."""
    canonical, metadata = car(kind)
    assert hashlib.sha256(frozen_graph(canonical.onnx, metadata)).hexdigest() == sha256


@pytest.mark.parametrize("form", [CAR, OPENVINO])
def test_archives_hold_what_their_readers_look_for(form: str) -> None:
    canonical, metadata = car("trained, discrete")
    packed = export_model(canonical.onnx, metadata, form)
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        names = archive.getnames()
        said = json.load(archive.extractfile("model_metadata.json") or io.BytesIO())
    network = ["agent/model.pb"] if form == CAR else ["model.xml", "model.bin"]
    assert names == [*network, "model_metadata.json"]
    assert said == metadata.to_dict()
    assert export_model(canonical.onnx, metadata, form) == packed


@pytest.mark.parametrize("kind", ["trained, stereo and lidar", "camera and discretised lidar"])
def test_the_file_for_a_car_uploaded_again_is_the_same_model(kind: str) -> None:
    canonical, metadata = car(kind)
    packed = export_model(canonical.onnx, metadata, CAR)
    package = read_upload([UploadPart("model.tar.gz", io.BytesIO(packed))])
    again = admit_network(package.kind, package.model, parse_metadata(package.metadata_json), DEFAULT_LIMITS)
    assert (again.sha256, again.onnx) == (canonical.sha256, canonical.onnx)


def test_sac_that_does_not_end_in_tanh_answers_its_inverse(tmp_path: Path) -> None:
    """Cars take the tanh themselves, so of what is in [-1, 1] already the policy is what tanh makes it of."""
    graph = coach_graph(head="continuous", middleware=[8])
    plain = read({"head": "continuous"})
    canonical = admit(graph, plain)
    sac = read({"head": "sac"})
    feeds = feeds_of(sac)
    expected = [np.clip(runtimes(canonical, plain, feed), -1, 1) for feed in feeds]
    found = openvinos(written(canonical, sac, CAR, tmp_path), sac, feeds)
    np.testing.assert_allclose(np.concatenate(found), np.concatenate(expected), atol=1e-5)


def test_a_network_that_no_format_can_say_is_refused_with_a_reason() -> None:
    from onnx import TensorProto, helper

    nodes = [
        helper.make_node("Cast", [CAMERA], ["half"], to=TensorProto.FLOAT16),
        helper.make_node("Cast", ["half"], ["float"], to=TensorProto.FLOAT),
        helper.make_node("GlobalMaxPool", ["float"], ["most"]),
        helper.make_node("Concat", ["most", "most"], ["two"], axis=2),
        helper.make_node("Flatten", ["two"], ["actions"]),
    ]
    sizes = {CAMERA: (1, 1, 120, 160), "actions": (1, 2)}
    port, output = (helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in sizes.items())
    graph = helper.make_graph(nodes, "half", [port], [output])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    metadata = read({"head": "continuous"})
    canonical = check_onnx(model.SerializeToString(), metadata)
    for form in (CAR, OPENVINO):
        with pytest.raises(UserFault) as fault:
            export_model(canonical.onnx, metadata, form)
        assert fault.value.code == "export_operator"
        assert fault.value.params["operator"] == "Cast"

"""The cars of the golden runs: house cars, and networks built for the other sensors. Imports no torch, no Django.

Built networks consist of the house cars' layers, so that they stay on the road for a while, and of numbers computed
from integers, which are the same on every machine.
"""

import functools
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import onnx
from onnx import ModelProto, NodeProto, TensorProto, helper, numpy_helper

from paddock.network.bound import FactsDocument
from paddock.packages.admission import admit_network
from paddock.packages.gate import check_onnx
from paddock.packages.inputs import input_spec
from paddock.packages.kinds import ONNX
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import MetadataDocument, parse_metadata
from paddock.packages.own import OwnCar

HOUSE_CARS = Path(__file__).resolve().parent.parent / "house_cars"
FRONT, LEFT, STEREO = "FRONT_FACING_CAMERA", "LEFT_CAMERA", "STEREO_CAMERAS"
LIDAR_CONFIG: dict[str, float] = {"num_sectors": 16, "num_values_per_sector": 4, "clipping_dist": 4.0}


class HouseCarDocument(MetadataDocument, total=False):
    """The JSON file beside a house car's network: its metadata, and maybe the facts of its admission."""

    facts: FactsDocument
    house_car: dict[str, object]


Built = tuple[bytes, HouseCarDocument]


@functools.cache
def car(name: str) -> OwnCar:
    """The car called ``name``: one of :data:`BUILT`, a house car, or the path of another (``FOLDER/NAME``, two files
    as a house car's). Raises UserFault where the gate refuses it, OSError where there is none.

    A file that has ``facts`` in its JSON is not tried out again."""
    build = BUILT.get(name)
    network, described = build() if build else _read(name)
    metadata = parse_metadata(json.dumps(described).encode())
    if "facts" in described:
        canonical, facts = check_onnx(network, metadata), described["facts"]
    else:
        canonical = admit_network(ONNX, network, metadata, DEFAULT_LIMITS)
        facts = canonical.facts.to_dict()
    return OwnCar(canonical.onnx, metadata.to_dict(), facts, canonical.sha256)


def _read(name: str) -> Built:
    path = Path(name) if "/" in name else HOUSE_CARS / name
    return path.with_suffix(".onnx").read_bytes(), json.loads(path.with_suffix(".json").read_text())


def _both_eyes() -> Built:
    """Brisk with a stereo pair: it sees the mean of two pictures."""
    network, described = _opened("brisk")
    first = next(tensor for tensor in network.graph.initializer if tensor.name == "conv1")
    kernel = numpy_helper.to_array(first)
    first.CopyFrom(numpy_helper.from_array(np.repeat(kernel / 2, 2, axis=1), "conv1"))
    del network.graph.input[:]
    network.graph.input.append(helper.make_tensor_value_info(STEREO, TensorProto.FLOAT, [1, 2, 120, 160]))
    _rename(network, FRONT, STEREO)
    return network.SerializeToString(), {**described, "sensor": [STEREO]}


def _with_lidar(base: str, lidar: str, reach: float) -> Built:
    """A house car with a lidar, each value of which changes every output by at most ``reach``."""
    network, described = _opened(base)
    graph = network.graph
    (output,) = graph.output
    values, outputs = input_spec(lidar, LIDAR_CONFIG).shape[0], output.type.tensor_type.shape.dim[1].dim_value
    _rename(network, output.name, "seen")
    graph.input.append(helper.make_tensor_value_info(lidar, TensorProto.FLOAT, [1, values]))
    graph.initializer.append(numpy_helper.from_array(numbers((values, outputs), reach, seed=values), "beams"))
    graph.node.extend(
        [
            helper.make_node("MatMul", [lidar, "beams"], ["felt"]),
            helper.make_node("Add", ["seen", "felt"], [output.name]),
        ]
    )
    return network.SerializeToString(), {**described, "sensor": [FRONT, lidar], "lidar_config": LIDAR_CONFIG}


def _wanderer() -> Built:
    """Discrete actions by untrained numbers: the car leaves the road again and again."""
    nodes = [
        helper.make_node("Cast", [LEFT], ["rows"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["rows"], ["picture"], perm=[0, 3, 1, 2]),
        helper.make_node("Mul", ["picture", "scale"], ["light"]),
        helper.make_node("Conv", ["light", "kernel"], ["edges"], strides=[8, 8]),
        helper.make_node("Tanh", ["edges"], ["bent"]),
        helper.make_node("Flatten", ["bent"], ["flat"]),
        helper.make_node("MatMul", ["flat", "head"], ["scores"]),
        helper.make_node("Softmax", ["scores"], ["actions"], axis=-1),
    ]
    weights = {
        "scale": np.array(1 / 256, np.float32),
        "kernel": numbers((8, 1, 8, 8), 0.25, seed=1),
        "head": numbers((8 * 15 * 20, 5), 0.25, seed=2),
    }
    actions = [
        {"steering_angle": angle, "speed": speed}
        for angle, speed in ((-30, 1.0), (-15, 2.0), (0, 3.0), (15, 2.0), (30, 1.0))
    ]
    return _network(nodes, weights, LEFT, 5), _metadata(LEFT, actions)


def _drifter() -> Built:
    """Continuous commands by untrained numbers."""
    nodes = [
        helper.make_node("Cast", ["observation"], ["rows"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["rows"], ["picture"], perm=[0, 3, 1, 2]),
        helper.make_node("Mul", ["picture", "scale"], ["light"]),
        helper.make_node("Conv", ["light", "kernel"], ["edges"], strides=[4, 4]),
        helper.make_node("Elu", ["edges"], ["bent"]),
        helper.make_node("MaxPool", ["bent"], ["pooled"], kernel_shape=[3, 3], strides=[3, 3]),
        helper.make_node("Flatten", ["pooled"], ["flat"]),
        helper.make_node("MatMul", ["flat", "dense"], ["features"]),
        helper.make_node("Sigmoid", ["features"], ["some"]),
        helper.make_node("MatMul", ["some", "head"], ["both"]),
        helper.make_node("Tanh", ["both"], ["actions"]),
    ]
    weights = {
        "scale": np.array(1 / 256, np.float32),
        "kernel": numbers((8, 1, 8, 8), 0.5, seed=3),
        "dense": numbers((8 * 9 * 13, 32), 0.25, seed=4),
        "head": numbers((32, 2), 0.5, seed=5),
    }
    space = {"steering_angle": {"low": -20.0, "high": 20.0}, "speed": {"low": 1.0, "high": 2.0}}
    return _network(nodes, weights, "observation", 2), _metadata("observation", space)


# A name of a golden run's car, and what builds it.
BUILT: dict[str, Callable[[], Built]] = {
    "both-eyes": _both_eyes,
    "beams": functools.partial(_with_lidar, "brisk", "LIDAR", 0.125),
    "sectors": functools.partial(_with_lidar, "steady", "SECTOR_LIDAR", 0.5),
    "steps": functools.partial(_with_lidar, "flyer", "DISCRETIZED_SECTOR_LIDAR", 0.0625),
    "wanderer": _wanderer,
    "drifter": _drifter,
}


def numbers(shape: Sequence[int], reach: float, seed: int) -> np.ndarray:
    """Float32 between ``-reach`` and ``reach`` (a power of two, so that nothing is rounded), scattered by integers."""
    mixed = np.arange(np.prod(shape), dtype=np.uint64) + np.uint64(seed << 32)
    for shift, factor in ((33, 0xFF51AFD7ED558CCD), (33, 0xC4CEB9FE1A85EC53), (33, 1)):  # MurmurHash3's last steps
        mixed = (mixed ^ mixed >> np.uint64(shift)) * np.uint64(factor)
    whole = (mixed >> np.uint64(40)).astype(np.int64) - (1 << 23)
    return (whole.astype(np.float32) * np.float32(reach / (1 << 23))).reshape(shape)


def _opened(name: str) -> tuple[ModelProto, HouseCarDocument]:
    network, described = _read(name)
    described.pop("house_car", None)
    return onnx.load_model_from_string(network), described


def _rename(network: ModelProto, before: str, after: str) -> None:
    """Rename a value of the graph, but not its input or output."""
    for node in network.graph.node:
        for names in (node.input, node.output):
            names[:] = [after if name == before else name for name in names]


def _network(nodes: list[NodeProto], weights: dict[str, np.ndarray], sensor: str, outputs: int) -> bytes:
    graph = helper.make_graph(
        nodes,
        "car",
        [helper.make_tensor_value_info(sensor, TensorProto.UINT8, [1, 120, 160, 1])],
        [helper.make_tensor_value_info("actions", TensorProto.FLOAT, [1, outputs])],
        [numpy_helper.from_array(value, name) for name, value in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return model.SerializeToString(deterministic=True)


def _metadata(sensor: str, space: list[dict[str, float]] | dict[str, dict[str, float]]) -> HouseCarDocument:
    return {
        "action_space": space,
        "action_space_type": "discrete" if isinstance(space, list) else "continuous",
        "sensor": [sensor],
        "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
        "training_algorithm": "clipped_ppo" if isinstance(space, list) else "sac",
        "version": "5",
    }

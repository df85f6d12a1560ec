"""Building blocks of hostile uploads: archives byte by byte, and ONNX networks that are good but for one thing."""

from __future__ import annotations

import io
import json
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from tests.paddock.packages.coach import coach_graph, metadata_dict
from tests.paddock.packages.graphdef import FLOAT, Attr, GraphWriter, field, varint

Upload = list[tuple[str, bytes]]
CAMERA = "FRONT_FACING_CAMERA"


# --- metadata


def metadata(**changes: object) -> bytes:
    """Good metadata of a car with five actions, with some keys changed; None removes one."""
    data = {**metadata_dict(), **changes}
    return json.dumps({key: value for key, value in data.items() if value is not None}).encode()


# --- ONNX


def network(
    nodes: list[onnx.NodeProto] | None = None,
    weights: dict[str, np.ndarray] | None = None,
    *,
    inputs: list[onnx.ValueInfoProto] | None = None,
    outputs: list[onnx.ValueInfoProto] | None = None,
    opset: int = 17,
    domains: tuple[str, ...] = (),
    functions: list[onnx.FunctionProto] | None = None,
) -> onnx.ModelProto:
    """A network over the front camera that ends in ``scores``. Without arguments: mean of the picture, five scores.

    Given nodes start from ``picture`` (float [1,120,160,1]) and ``row`` ([1,1], the mean) and end in ``x``; a dense
    layer over ``x`` ([1,1]) makes the scores, unless they make ``scores`` themselves.
    """
    nodes = [helper.make_node("Identity", ["row"], ["x"])] if nodes is None else nodes
    head = [
        helper.make_node("Cast", [CAMERA], ["picture"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["picture"], ["mean"], axes=[1, 2, 3], keepdims=0),
        helper.make_node("Unsqueeze", ["mean", "one"], ["row"]),
    ]
    made = {name for node in nodes for name in node.output}
    tail = [] if "scores" in made else [helper.make_node("Gemm", ["x", "dense", "bias"], ["scores"])]
    constants = {
        "one": np.array([1], np.int64),
        "dense": np.linspace(-1, 1, 5, dtype=np.float32).reshape(1, 5),
        "bias": np.zeros(5, np.float32),
        **(weights or {}),
    }
    graph = helper.make_graph(
        [*head, *nodes, *tail],
        "car",
        inputs or [helper.make_tensor_value_info(CAMERA, TensorProto.UINT8, [1, 120, 160, 1])],
        outputs or [helper.make_tensor_value_info("scores", TensorProto.FLOAT, [1, 5])],
        [numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    opsets = [helper.make_opsetid("", opset), *(helper.make_opsetid(domain, 1) for domain in domains)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=8, functions=functions or [])


def good_network() -> bytes:
    return network().SerializeToString()


def pair(model: bytes | onnx.ModelProto, data: bytes | None = None) -> Upload:
    """A network and its metadata as two files."""
    content = model if isinstance(model, bytes) else model.SerializeToString()
    return [("car.onnx", content), ("model_metadata.json", metadata() if data is None else data)]


def one_node(op: str, inputs: list[str], weights: dict[str, np.ndarray] | None = None, **attributes: object) -> Upload:
    """A good network with one more node between the mean and the scores."""
    return pair(network([helper.make_node(op, inputs, ["x"], **attributes)], weights))


def outside(place: dict[str, str], content: bytes, again: dict[str, str] | None = None) -> Upload:
    """A network whose five weights of the bias lie, as it says, at ``place``, with ``content`` in car.onnx.data."""
    model = network()
    tensor = TensorProto(name="far", data_type=TensorProto.FLOAT, dims=[5], data_location=TensorProto.EXTERNAL)
    for said in (place, again or {}):
        for key, value in said.items():
            tensor.external_data.add(key=key, value=value)
    model.graph.initializer.append(tensor)
    model.graph.node[-1].input[2] = "far"
    return [("car.onnx", model.SerializeToString()), ("car.onnx.data", content), ("model_metadata.json", metadata())]


# --- TensorFlow


def car(graph: bytes, data: bytes | None = None) -> Upload:
    """A car's archive."""
    return archive(("agent/model.pb", graph), ("model_metadata.json", metadata() if data is None else data))


def graph_with(*steps: tuple[str, str, tuple[str, ...]], **constants: object) -> Upload:
    """A car whose graph is a placeholder ``camera``, constants, and these nodes; the last is the policy."""
    writer = GraphWriter()
    shape = Attr.shape((-1, 120, 160, 1))
    writer.node(f"camera/{CAMERA}", "Placeholder", dtype=Attr.dtype(FLOAT), shape=shape)
    for name, value in constants.items():
        writer.const(name, value, getattr(value, "dtype", np.dtype("float32")).name)
    for name, op, inputs in steps:
        writer.op(name, op, *(f"camera/{CAMERA}" if source == "camera" else source for source in inputs))
    return car(writer.build())


def small_car() -> bytes:
    return coach_graph(middleware=[8])


# --- tar


def tar(*members: tuple[str, bytes], **options: object) -> bytes:
    """A plain tar of regular files, by the standard library."""
    return tar_of(*(regular(name, content) for name, content in members), **options)


def tar_of(*members: tuple[tarfile.TarInfo, bytes], **options: object) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", **options) as archive_file:
        for info, content in members:
            archive_file.addfile(info, io.BytesIO(content))
    return buffer.getvalue()


def regular(name: str, content: bytes) -> tuple[tarfile.TarInfo, bytes]:
    info = tarfile.TarInfo(name)
    info.size = len(content)
    return info, content


def special(name: str, kind: bytes, target: str = "") -> tuple[tarfile.TarInfo, bytes]:
    """A link, device, pipe and the like."""
    info = tarfile.TarInfo(name)
    info.type, info.linkname = kind, target
    return info, b""


def gzip(content: bytes) -> bytes:
    engine = zlib.compressobj(1, zlib.DEFLATED, 16 + zlib.MAX_WBITS)
    return engine.compress(content) + engine.flush()


def archive(*members: tuple[str, bytes]) -> Upload:
    return [("model.tar.gz", gzip(tar(*members)))]


def with_files(*more: tuple[tarfile.TarInfo, bytes]) -> Upload:
    """A good car's archive with more members in front."""
    members = (*more, regular("agent/model.pb", small_car()), regular("model_metadata.json", metadata()))
    return [("model.tar.gz", gzip(tar_of(*members)))]


def training_folder(
    iterations: dict[int, bytes],
    best: bytes | None = None,
    metadata_json: bytes | None = b"",
    *,
    lead: str = "",
    more: tuple[tuple[str, bytes], ...] = (),
    packed: Callable[..., Upload] = archive,
) -> Upload:
    """The folder of a training as DeepRacer-for-Cloud writes it: frozen graphs by iteration, ``best``: the content of
    deepracer_checkpoints.json, beside checkpoints, logs and notes."""
    members = [(f"model/model_{number}.pb", graph) for number, graph in iterations.items()]
    if best is not None:
        members.append(("model/deepracer_checkpoints.json", best))
    if metadata_json is not None:
        members.append(("model/model_metadata.json", metadata_json or metadata()))
    members += [
        ("model/.coach_checkpoint", b"7_Step-100.ckpt"),
        ("model/7_Step-100.ckpt.index", b"index"),
        ("model/7_Step-100.ckpt.data-00000-of-00001", bytes(100_000)),
        ("ip/hyperparameters.json", b"{}"),
        ("metrics/TrainingMetrics.json", b'{"metrics": []}'),
        ("reward_function.py", b"def reward_function(params):\n    return 1.0\n"),
        ("checksum.txt", b"d41d8cd98f00b204e9800998ecf8427e"),
        ("notes.md", b"faster in turn 3"),
    ]
    return packed(*((lead + name, content) for name, content in (*members, *more)))


# --- zip


def zipped(*members: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip by the standard library."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive_file:
        for name, content in members:
            archive_file.writestr(name, content)
    return buffer.getvalue()


def good_zip(*more: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> Upload:
    """A good network in a zip, with more members in front."""
    members = (*more, ("car.onnx", good_network()), ("model_metadata.json", metadata()))
    return [("car.zip", zipped(*members, method=method))]


class ZipEntry:
    """One entry written by hand, every field of which may lie."""

    def __init__(
        self, name: bytes, content: bytes, *, method: int = 0, flags: int = 0, wide: bytes | None = None, **lies: int
    ) -> None:
        self.extra = b"" if wide is None else struct.pack("<HH", 1, len(wide)) + wide
        engine = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
        self.name, self.method, self.flags = name, method, flags
        self.data = engine.compress(content) + engine.flush() if method == 8 else content
        self.crc = lies.get("crc", zlib.crc32(content))
        self.size = lies.get("size", len(content))
        self.packed = lies.get("packed", len(self.data))
        self.offset: int | None = lies.get("offset")

    def local(self) -> bytes:
        sizes = (0xFFFFFFFF, 0xFFFFFFFF) if self.extra else (self.packed, self.size)
        head = struct.pack(
            "<4s5H3L2H", b"PK\x03\x04", 20, self.flags, self.method, 0, 0, self.crc, *sizes,
            len(self.name), len(self.extra),
        )  # fmt: skip
        return head + self.name + self.extra + self.data

    def central(self, offset: int) -> bytes:
        at = offset if self.offset is None else self.offset
        head = struct.pack(
            "<4s6H3L5H2L", b"PK\x01\x02", 20, 20, self.flags, self.method, 0, 0, self.crc, self.packed, self.size,
            len(self.name), 0, 0, 0, 0, 0, at,
        )  # fmt: skip
        return head + self.name


def zip_by_hand(*entries: ZipEntry, count: int | None = None, comment: bytes = b"") -> bytes:
    body, directory = b"", b""
    for entry in entries:
        directory += entry.central(len(body))
        if entry.offset is None:
            body += entry.local()
    number = len(entries) if count is None else count
    end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, number, number, len(directory), len(body), len(comment))
    return body + directory + end + comment


__all__ = [name for name in globals() if not name.startswith("_")] + ["field", "varint"]

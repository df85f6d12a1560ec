"""Writes ``tensorflow_graphs.tar.xz``: frozen policy graphs made by TensorFlow itself, with its answers.

    python -m tests.paddock.packages.tensorflow_graphs    (needs tensorflow-cpu and tf_keras)

The layers, names and heads are those of RL-Coach and deepracer-simapp, as far as facts go: embedders, middleware, the
rescaling of gradients, ``ppo_head``, ``sac_policy_head``. Layers are narrow and weights are eighths, so that a graph
takes a few kilobytes. ``first``: the control flow and variables of TensorFlow 1 (``Switch``, ``VariableV2``);
``second``: those of TensorFlow 2 (``If`` with functions, ``ReadVariableOp``), as newer simulators write them.
"""

from __future__ import annotations

import io
import itertools
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ARCHIVE = Path(__file__).with_name("tensorflow_graphs.tar.xz")
SHALLOW, MEDIUM, DEEP = (
    "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "DEEP_CONVOLUTIONAL_NETWORK",
    "DEEP_CONVOLUTIONAL_NETWORK_DEEP",
)
SHAPES: dict[str, tuple[int, ...]] = {
    "FRONT_FACING_CAMERA": (120, 160, 1),
    "LEFT_CAMERA": (120, 160, 1),
    "observation": (120, 160, 1),
    "STEREO_CAMERAS": (120, 160, 2),
    "LIDAR": (64,),
    "SECTOR_LIDAR": (8,),
    "DISCRETIZED_SECTOR_LIDAR": (64,),
}
SENSORS = (
    ("FRONT_FACING_CAMERA",),
    ("STEREO_CAMERAS",),
    ("observation",),
    ("LEFT_CAMERA",),
    ("FRONT_FACING_CAMERA", "LIDAR"),
    ("FRONT_FACING_CAMERA", "SECTOR_LIDAR"),
    ("STEREO_CAMERAS", "LIDAR"),
    ("STEREO_CAMERAS", "SECTOR_LIDAR"),
    ("LEFT_CAMERA", "DISCRETIZED_SECTOR_LIDAR"),
)
# ``sac``: two dense layers for mean and deviation; ``sac_slices``: one, cut by [..., :n] and [..., n:];
# ``sac_tanh``: the latter, squashed within the graph
HEADS = ("discrete", "continuous", "sac", "sac_slices")
_CONVOLUTIONS = {
    SHALLOW: ((8, 4), (4, 2), (3, 1)),
    MEDIUM: ((5, 2), (3, 1), (3, 2), (3, 1)),
    DEEP: ((8, 4), (4, 2), (4, 2), (3, 1)),
}
_DENSE = {SHALLOW: 0, MEDIUM: 1, DEEP: 2}
_FILTERS, _WIDTH, _ACTIONS = 2, 6, 5


@dataclass(frozen=True)
class Case:
    """One graph. ``whole``: frozen with all outputs of its head, not with the policy only."""

    head: str
    depth: str
    sensors: tuple[str, ...]
    version: str = "first"
    whole: bool = False

    @property
    def name(self) -> str:
        return "-".join(
            [self.head, self.depth.removeprefix("DEEP_CONVOLUTIONAL_NETWORK").strip("_").lower() or "medium",
             *self.sensors, self.version, *(["whole"] if self.whole else [])]
        )  # fmt: skip


def cases() -> list[Case]:
    """Every head with every depth and both versions, the sensors in turn; the sliced head with every set of sensors."""
    turns = itertools.cycle(SENSORS)
    found = [
        Case(head, depth, next(turns), version)
        for head in HEADS
        for depth in (SHALLOW, MEDIUM, DEEP)
        for version in ("first", "second")
    ]
    found += [Case("sac_slices", depth, sensors) for sensors in SENSORS for depth in (SHALLOW, DEEP)]
    found += [Case(head, SHALLOW, ("FRONT_FACING_CAMERA",), whole=True) for head in ("continuous", "sac", "sac_slices")]
    found += [Case("sac_tanh", SHALLOW, ("FRONT_FACING_CAMERA",)), Case("discrete", DEEP, ("FRONT_FACING_CAMERA",))]
    return list({case.name: case for case in found}.values())


def frame(sensor: str) -> np.ndarray:
    """One observation, the same everywhere."""
    shape = SHAPES[sensor]
    numbers = np.arange(int(np.prod(shape)), dtype=np.int64)
    values = (numbers * 37 + numbers * numbers // 11) % 256
    if len(shape) == 1:
        return (values / 256).astype(np.float32).reshape(1, *shape)
    return values.astype(np.uint8).reshape(1, *shape)


class _Builder:
    def __init__(self, tensorflow: Any, case: Case) -> None:
        self._tf, self._v1, self._case = tensorflow, tensorflow.compat.v1, case
        self._layers = self._v1.layers

    def build(self) -> tuple[bytes, np.ndarray]:
        """The frozen graph and its policy's answer."""
        v1, case = self._v1, self._case
        sac = case.head.startswith("sac")
        scope = f"main_level/agent/{'policy' if sac else 'main'}/online"
        with self._tf.Graph().as_default() as graph:
            with v1.variable_scope(scope):
                self._training = v1.Variable(False, trainable=False)
                inputs = {}
                with v1.variable_scope("network_0"):
                    for sensor in case.sensors:
                        with v1.variable_scope(sensor):
                            inputs[sensor] = v1.placeholder("float", [None, *SHAPES[sensor]], name=sensor)
                with v1.variable_scope("network_0" if sac else "network_1", auxiliary_name_scope=not sac):
                    outputs = self._network(inputs)
            with v1.Session(graph=graph) as session:
                session.run(v1.global_variables_initializer())
                self._set_weights(session)
                kept = outputs if case.whole else outputs[:1]
                frozen = self._freeze(session, graph, [output.op.name for output in kept])
                feed = {inputs[sensor]: frame(sensor) for sensor in case.sensors}
                answer = session.run(outputs[0], feed)
        return frozen, answer

    def _network(self, inputs: dict[str, Any]) -> list[Any]:
        tf, v1, case = self._tf, self._v1, self._case
        embedded = []
        for sensor in sorted(inputs):
            with v1.variable_scope(sensor):
                embedded.append(self._embedder(sensor, inputs[sensor]))
        state = embedded[0] if len(embedded) == 1 else tf.concat(embedded, axis=-1, name="merger")
        with v1.variable_scope("middleware_fc_embedder"):
            for number in range(2 if case.depth == DEEP else 1):
                state = self._layers.dense(state, _WIDTH, name=f"Dense_{2 * number}")
                state = self._after(state, f"BatchnormActivationDropout_{2 * number + 1}", dense=True)
        rescaler = v1.get_variable("gradients_from_head_0-0_rescalers", initializer=np.float32(1.0))
        state = (1 - rescaler) * tf.stop_gradient([state]) + rescaler * [state]
        head = "sac_policy_head_0" if case.head.startswith("sac") else "ppo_head_0"
        with v1.variable_scope(head):
            return getattr(self, f"_{case.head}")(state[0])

    def _embedder(self, sensor: str, value: Any) -> Any:
        tf, case = self._tf, self._case
        picture = len(SHAPES[sensor]) == 3
        value = value / (255.0 if picture else 1.0)
        value -= 0.0
        layer = 0
        for kernel, stride in _CONVOLUTIONS[case.depth] if picture else ():
            value = self._layers.conv2d(value, _FILTERS, kernel, stride, name=f"Conv2d_{layer}")
            value = self._after(value, f"BatchnormActivationDropout_{layer + 1}", dense=False)
            layer += 2
        for _ in range(_DENSE[case.depth] if picture else 2):
            value = self._layers.dense(value, _WIDTH, name=f"Dense_{layer}")
            value = self._after(value, f"BatchnormActivationDropout_{layer + 1}", dense=True)
            layer += 2
        if case.version == "second":
            return self._layers.flatten(value)
        flat = tf.reshape(value, tf.stack([tf.shape(value)[0], -1]))
        flat.set_shape([None, int(np.prod(value.shape.as_list()[1:]))])
        return flat

    def _after(self, value: Any, name: str, dense: bool) -> Any:
        """Batch normalisation of pictures and dropout of rows, where the depth has them."""
        tf, case = self._tf, self._case
        if case.depth != SHALLOW and not dense:
            value = self._layers.batch_normalization(value, name=f"{name}_batchnorm", training=self._training)
        value = (tf.tanh if case.depth == MEDIUM else tf.nn.relu)(value, name=f"{name}_activation")
        if case.depth != SHALLOW and dense:
            value = self._layers.dropout(value, 0.3, name=f"{name}_dropout", training=self._training)
        return value

    def _discrete(self, state: Any) -> list[Any]:
        return [self._tf.nn.softmax(self._layers.dense(state, _ACTIONS, name="policy_fc"), name="policy")]

    def _continuous(self, state: Any) -> list[Any]:
        tf, v1 = self._tf, self._v1
        mean = tf.identity(self._layers.dense(state, 2, name="policy_mean"), name="policy")
        deviation = v1.get_variable("policy_log_std", initializer=np.zeros((1, 2), np.float32))
        return [mean, tf.tile(tf.exp(deviation), [tf.shape(state)[0], 1], name="policy_std")]

    def _sac(self, state: Any) -> list[Any]:
        both = self._layers.dense(state, _WIDTH, activation=self._tf.nn.relu)
        mean = self._tf.identity(self._layers.dense(both, 2, name="policy_mean"), name="policy")
        return [mean, *self._sampled(mean, self._layers.dense(both, 2))]

    def _sac_slices(self, state: Any) -> list[Any]:
        both = self._layers.dense(state, 4, name="policy_mu_logsig")
        mean = self._tf.identity(both[..., :2], name="policy")
        return [mean, *self._sampled(mean, both[..., 2:])]

    def _sac_tanh(self, state: Any) -> list[Any]:
        both = self._layers.dense(state, 4, name="policy_mu_logsig")
        return [self._tf.tanh(both[..., :2], name="policy")]

    def _sampled(self, mean: Any, deviation: Any) -> list[Any]:
        tf = self._tf
        deviation = tf.clip_by_value(deviation, -20, 2, name="policy_log_std")
        actions = tf.tanh(mean + tf.exp(deviation) * tf.random.normal(tf.shape(mean)), name="actions")
        return [deviation, tf.clip_by_value(actions, -1.0, 1.0)]

    def _set_weights(self, session: Any) -> None:
        """Eighths, which are packed well; variances and the like stay positive."""
        random = np.random.default_rng(5)
        for variable in self._v1.global_variables():
            shape = variable.shape.as_list()
            if not shape or "policy_log_std" in variable.name:
                continue
            positive = "moving_variance" in variable.name or "gamma" in variable.name
            values = random.integers(4, 13, shape) if positive else random.integers(-4, 5, shape)
            variable.load(values.astype(np.float32) / 8, session)

    def _freeze(self, session: Any, graph: Any, outputs: list[str]) -> bytes:
        v1, definition = self._v1, graph.as_graph_def()
        if self._case.version == "second":
            return v1.graph_util.convert_variables_to_constants(session, definition, outputs).SerializeToString()
        # what TensorFlow 1 did: each variable becomes a constant of its name, which is still read by an Identity
        definition = v1.graph_util.extract_sub_graph(definition, outputs)
        variables = [node for node in definition.node if node.op == "VariableV2"]
        values = session.run([f"{node.name}:0" for node in variables])
        for node, value in zip(variables, values, strict=True):
            name, kind = node.name, node.attr["dtype"].type
            node.Clear()
            node.name, node.op = name, "Const"
            node.attr["dtype"].type = kind
            node.attr["value"].tensor.CopyFrom(self._tf.make_tensor_proto(value, dtype=kind, shape=value.shape))
        return definition.SerializeToString()


def main(version: str, folder: Path) -> None:
    """Write the graphs of one version: TensorFlow takes the other's control flow only in another process."""
    os.environ.update(TF_CPP_MIN_LOG_LEVEL="3", TF_USE_LEGACY_KERAS="1", TF_ENABLE_ONEDNN_OPTS="0")
    import tensorflow

    if version == "first":
        tensorflow.compat.v1.disable_v2_behavior()
    else:
        tensorflow.compat.v1.disable_eager_execution()
    tensorflow.compat.v1.logging.set_verbosity("ERROR")
    for case in cases():
        if case.version == version:
            graph, answer = _Builder(tensorflow, case).build()
            (folder / f"{case.name}.pb").write_bytes(graph)
            (folder / f"{case.name}.json").write_text(json.dumps(answer.tolist()))


def write_archive() -> None:
    """All graphs in one archive, which packs what they have in common once."""
    with tempfile.TemporaryDirectory() as folder:
        for version in ("first", "second"):
            subprocess.run([sys.executable, __file__, version, folder], check=True)
        with tarfile.open(ARCHIVE, "w:xz", preset=9) as archive:
            for path in sorted(Path(folder).iterdir()):
                member = tarfile.TarInfo(path.name)
                member.size = path.stat().st_size
                archive.addfile(member, io.BytesIO(path.read_bytes()))


if __name__ == "__main__":
    if len(sys.argv) == 3:
        main(sys.argv[1], Path(sys.argv[2]))
    else:
        write_archive()

"""Networks as RL-Coach builds and freezes them for DeepRacer, with random weights.

Layer tables: deepracer-simapp, markov/sensors/utils.py; heads: rl_coach's ppo_head and markov's sac_head; names as in
the console's own graph (`test_console_car.py` compares them node by node).
"""

from __future__ import annotations

import numpy as np

from paddock.packages.inputs import input_spec

from .graphdef import BOOL, FLOAT, INT32, Attr, GraphWriter

SHALLOW, MEDIUM, DEEP = (
    "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "DEEP_CONVOLUTIONAL_NETWORK",
    "DEEP_CONVOLUTIONAL_NETWORK_DEEP",
)
_CAMERA = {
    SHALLOW: ([(32, 8, 4), (64, 4, 2), (64, 3, 1)], []),
    MEDIUM: ([(32, 5, 2), (32, 3, 1), (64, 3, 2), (64, 3, 1)], [64]),
    DEEP: ([(32, 8, 4), (32, 4, 2), (64, 4, 2), (64, 3, 1)], [512, 512]),
}
_STEREO_DEEP = ([(32, 3, 1), (64, 3, 2), (64, 3, 1), (128, 3, 2), (128, 3, 1)], [])
_MIDDLEWARE = {SHALLOW: [512], MEDIUM: [512], DEEP: [256, 128]}


class CoachNetwork:
    """Builds one frozen policy graph; see :func:`coach_graph` for the parameters."""

    def __init__(
        self,
        sensors: list[str],
        depth: str,
        head: str,
        actions: int,
        *,
        middleware: list[int] | None = None,
        agent: str = "agent",
        activation: str = "Relu",
        batch_norm: bool = False,
        dropout: bool = False,
        padding: str = "VALID",
        modern: bool = False,
        switches: bool = True,
        fused: str = "FusedBatchNorm",
        seed: int = 0,
    ) -> None:
        self.graph = GraphWriter(seed)
        self._depth, self._head, self._actions = depth, head, actions
        self._middleware = middleware or _MIDDLEWARE[depth]
        self._activation, self._batch_norm, self._dropout = activation, batch_norm, dropout
        self._padding, self._add = padding, "AddV2" if modern else "Add"
        self._modern, self._switches, self._fused = modern, switches, fused
        wrapper, network = ("policy", 0) if head == "sac" else ("main", 1)
        self._inputs = f"main_level/{agent}/{wrapper}/online/network_0"
        self._scope = f"main_level/{agent}/{wrapper}/online/network_{network}"
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._sensors = sorted(sensors)

    def build(self) -> bytes:
        if self._switches and (self._batch_norm or self._dropout):
            self._training = self._switch_training_off()
        embeddings = [self._embedder(sensor) for sensor in self._sensors]
        state = embeddings[0]
        width = sum(self._shapes[embedding][1] for embedding in embeddings)
        if len(embeddings) > 1:
            self.graph.const(f"{self._scope}/merger/axis", -1, "int32")
            count = Attr.integer(len(embeddings))
            state = self.graph.op(
                f"{self._scope}/merger", "ConcatV2", *embeddings, f"{self._scope}/merger/axis",
                N=count, Tidx=Attr.dtype(INT32),
            )  # fmt: skip
        for index, units in enumerate(self._middleware):
            scope = f"{self._scope}/middleware_fc_embedder"
            state = self._dense(f"{scope}/Dense_{2 * index}", state, width, units)
            state = self._after(f"{scope}/BatchnormActivationDropout_{2 * index + 1}", state, (1, units))
            width = units
        state = self._rescale_gradients(state)
        self._add_head(state, width)
        return self.graph.build()

    # --- embedders

    def _embedder(self, sensor: str) -> str:
        graph, scope, spec = self.graph, f"{self._scope}/{sensor}", input_spec(sensor)
        placeholder = f"{self._inputs}/{sensor}/{sensor}"
        graph.node(placeholder, "Placeholder", dtype=Attr.dtype(FLOAT), shape=Attr.shape((-1, *spec.shape)))
        graph.const(f"{scope}/truediv/y", 255.0 if spec.is_picture else 1.0)
        value = graph.op(f"{scope}/truediv", "RealDiv", placeholder, f"{scope}/truediv/y")
        graph.const(f"{scope}/sub/y", 0.0)
        value = graph.op(f"{scope}/sub", "Sub", value, f"{scope}/sub/y")
        shape = spec.channels_last
        convolutions, dense = ([], [256, 256]) if not spec.is_picture else _CAMERA[self._depth]
        if sensor == "STEREO_CAMERAS" and self._depth != SHALLOW:
            convolutions, dense = _STEREO_DEEP
        layer = 0
        for filters, kernel, stride in convolutions:
            value, shape = self._conv(f"{scope}/Conv2d_{layer}", value, shape, filters, kernel, stride)
            value = self._after(f"{scope}/BatchnormActivationDropout_{layer + 1}", value, shape)
            layer += 2
        for units in dense:
            name = f"{scope}/Dense_{layer}"
            if len(shape) == 4:
                value, shape = self._dense_on_picture(name, value, shape, units)
            else:
                value, shape = self._dense(name, value, shape[1], units), (1, units)
            value = self._after(f"{scope}/BatchnormActivationDropout_{layer + 1}", value, shape)
            layer += 2
        return self._flatten(f"{scope}/Flatten/flatten", value, shape)

    def _conv(
        self, name: str, value: str, shape: tuple[int, ...], filters: int, kernel: int, stride: int
    ) -> tuple[str, tuple[int, ...]]:
        graph = self.graph
        weight = graph.weights(f"{name}/kernel", (kernel, kernel, shape[3], filters))
        bias = graph.weights(f"{name}/bias", (filters,))
        value = graph.op(
            f"{name}/Conv2D", "Conv2D", value, weight,
            strides=Attr.integers([1, stride, stride, 1]), dilations=Attr.integers([1, 1, 1, 1]),
            padding=Attr.text(self._padding), data_format=Attr.text("NHWC"), use_cudnn_on_gpu=Attr.flag(True),
        )  # fmt: skip
        value = graph.op(f"{name}/BiasAdd", "BiasAdd", value, bias, data_format=Attr.text("NHWC"))
        reach = 0 if self._padding == "SAME" else kernel - 1
        height, width = (-(-(size - reach) // stride) for size in shape[1:3])
        return value, (1, height, width, filters)

    def _dense(self, name: str, value: str, width: int, units: int) -> str:
        graph = self.graph
        weight, bias = graph.weights(f"{name}/kernel", (width, units)), graph.weights(f"{name}/bias", (units,))
        off = Attr.flag(False)
        value = graph.op(f"{name}/MatMul", "MatMul", value, weight, transpose_a=off, transpose_b=off)
        return graph.op(f"{name}/BiasAdd", "BiasAdd", value, bias, data_format=Attr.text("NHWC"))

    def _dense_on_picture(
        self, name: str, value: str, shape: tuple[int, ...], units: int
    ) -> tuple[str, tuple[int, ...]]:
        """tf.layers.dense on four axes: tensordot over the last, with shapes worked out at run time."""
        graph, at = self.graph, f"{name}/Tensordot"
        weight, bias = graph.weights(f"{name}/kernel", (shape[3], units)), graph.weights(f"{name}/bias", (units,))
        types = {"Tindices": Attr.dtype(INT32), "Tparams": Attr.dtype(INT32), "Taxis": Attr.dtype(INT32)}
        whole, part = Attr.dtype(INT32), Attr.flag(False)
        graph.const(f"{at}/axes", [3], "int32")
        graph.const(f"{at}/free", [0, 1, 2], "int32")
        graph.op(f"{at}/Shape", "Shape", value, out_type=whole)
        for index, what in (("", "free"), ("_1", "axes")):
            graph.const(f"{at}/GatherV2{index}/axis", 0, "int32")
            graph.node(
                f"{at}/GatherV2{index}", "GatherV2",
                [f"{at}/Shape", f"{at}/{what}", f"{at}/GatherV2{index}/axis"], **types,
            )  # fmt: skip
            graph.const(f"{at}/Const{index}", [0], "int32")
            graph.node(
                f"{at}/Prod{index}", "Prod", [f"{at}/GatherV2{index}", f"{at}/Const{index}"],
                T=whole, Tidx=whole, keep_dims=part,
            )  # fmt: skip
        graph.const(f"{at}/concat/axis", 0, "int32")
        graph.node(
            f"{at}/concat", "ConcatV2", [f"{at}/free", f"{at}/axes", f"{at}/concat/axis"],
            T=whole, Tidx=whole, N=Attr.integer(2),
        )  # fmt: skip
        graph.node(f"{at}/stack", "Pack", [f"{at}/Prod", f"{at}/Prod_1"], T=whole, N=Attr.integer(2), axis=b"\x18\x00")
        graph.op(f"{at}/transpose", "Transpose", value, f"{at}/concat", Tperm=whole)
        graph.op(f"{at}/Reshape", "Reshape", f"{at}/transpose", f"{at}/stack", Tshape=whole)
        graph.const(f"{at}/transpose_1/perm", [0, 1], "int32")
        graph.op(f"{at}/transpose_1", "Transpose", weight, f"{at}/transpose_1/perm", Tperm=whole)
        graph.const(f"{at}/Reshape_1/shape", [shape[3], units], "int32")
        graph.op(f"{at}/Reshape_1", "Reshape", f"{at}/transpose_1", f"{at}/Reshape_1/shape", Tshape=whole)
        graph.op(f"{at}/MatMul", "MatMul", f"{at}/Reshape", f"{at}/Reshape_1", transpose_a=part, transpose_b=part)
        graph.const(f"{at}/Const_2", [units], "int32")
        graph.const(f"{at}/concat_1/axis", 0, "int32")
        graph.node(
            f"{at}/concat_1", "ConcatV2", [f"{at}/GatherV2", f"{at}/Const_2", f"{at}/concat_1/axis"],
            T=whole, Tidx=whole, N=Attr.integer(2),
        )  # fmt: skip
        graph.op(at, "Reshape", f"{at}/MatMul", f"{at}/concat_1", Tshape=whole)
        value = graph.op(f"{name}/BiasAdd", "BiasAdd", at, bias, data_format=Attr.text("NHWC"))
        return value, (*shape[:3], units)

    def _flatten(self, name: str, value: str, shape: tuple[int, ...]) -> str:
        graph, whole = self.graph, Attr.dtype(INT32)
        graph.op(f"{name}/Shape", "Shape", value, out_type=whole)
        self._first(f"{name}/strided_slice", f"{name}/Shape", INT32)
        graph.const(f"{name}/Reshape/shape/1", -1, "int32")
        graph.node(
            f"{name}/Reshape/shape", "Pack", [f"{name}/strided_slice", f"{name}/Reshape/shape/1"],
            T=whole, axis=Attr.integer(0), N=Attr.integer(2),
        )  # fmt: skip
        result = graph.op(f"{name}/Reshape", "Reshape", value, f"{name}/Reshape/shape", Tshape=whole)
        self._shapes[result] = (1, int(np.prod(shape)))
        return result

    def _first(self, name: str, source: str, dtype: int) -> str:
        """``source[0]``"""
        for suffix, value in (("stack", [0]), ("stack_1", [1]), ("stack_2", [1])):
            self.graph.const(f"{name}/{suffix}", value, "int32")
        masks = {f"{mask}_mask": Attr.integer(0) for mask in ("ellipsis", "begin", "new_axis", "end")}
        return self.graph.node(
            name, "StridedSlice", [source, *(f"{name}/{suffix}" for suffix in ("stack", "stack_1", "stack_2"))],
            T=Attr.dtype(dtype), Index=Attr.dtype(INT32), shrink_axis_mask=Attr.integer(1), **masks,
        )  # fmt: skip

    # --- after a layer

    def _after(self, name: str, value: str, shape: tuple[int, ...]) -> str:
        if self._batch_norm and len(shape) == 4:
            value = self._fused_batch_norm(f"{name}_batchnorm", value, shape[-1])
        elif self._batch_norm:
            value = self._plain_batch_norm(f"{name}_batchnorm", value, shape[-1])
        value = self.graph.op(f"{name}_activation", self._activation, value)
        return self._dropped_out(f"{name}_dropout", value) if self._dropout and self._switches else value

    def _switch_training_off(self) -> str:
        name = f"{self._scope}/Variable"
        self.graph.const(name, False, "bool")
        return self.graph.node(f"{name}/read", "Identity", [name], T=Attr.dtype(BOOL))

    def _branches(self, name: str) -> str:
        """tf.cond on the training flag, as TensorFlow 1 writes it; returns the condition's name."""
        flag = Attr.dtype(BOOL)
        self.graph.node(f"{name}/cond/Switch", "Switch", [self._training, self._training], T=flag)
        self.graph.node(f"{name}/cond/switch_t", "Identity", [f"{name}/cond/Switch:1"], T=flag)
        self.graph.node(f"{name}/cond/switch_f", "Identity", [f"{name}/cond/Switch"], T=flag)
        return self.graph.node(f"{name}/cond/pred_id", "Identity", [self._training], T=flag)

    def _fused_batch_norm(self, name: str, value: str, channels: int) -> str:
        graph = self.graph
        scale, offset = graph.positive(f"{name}/gamma", channels), graph.weights(f"{name}/beta", (channels,))
        mean, variance = (
            graph.weights(f"{name}/moving_mean", (channels,)), graph.positive(f"{name}/moving_variance", channels)
        )  # fmt: skip
        kind = "FusedBatchNormV3" if self._modern else self._fused
        common = {"epsilon": Attr.real(1e-3), "data_format": Attr.text("NHWC")}
        if not self._switches:
            return graph.op(name, kind, value, scale, offset, mean, variance, is_training=Attr.flag(False), **common)
        condition = self._branches(name)
        for index, source in enumerate((value, scale, offset)):
            graph.op(f"{name}/cond/{kind}/Switch_{index}", "Switch", source, condition)
        for number in (0, 1):
            graph.const(f"{name}/cond/Const_{number}", np.zeros(0), controls=(f"{name}/cond/switch_t",))
        graph.op(
            f"{name}/cond/{kind}", kind, *(f"{name}/cond/{kind}/Switch_{index}:1" for index in range(3)),
            f"{name}/cond/Const_0", f"{name}/cond/Const_1", is_training=Attr.flag(True), **common,
        )  # fmt: skip
        for index, source in enumerate((value, scale, offset, mean, variance)):
            graph.op(f"{name}/cond/{kind}_1/Switch_{index}", "Switch", source, condition)
        graph.op(
            f"{name}/cond/{kind}_1", kind, *(f"{name}/cond/{kind}_1/Switch_{index}" for index in range(5)),
            is_training=Attr.flag(False), **common,
        )  # fmt: skip
        return graph.op(
            f"{name}/cond/Merge", "Merge", f"{name}/cond/{kind}_1", f"{name}/cond/{kind}", N=Attr.integer(2)
        )

    def _plain_batch_norm(self, name: str, value: str, width: int) -> str:
        """Batch normalisation of a row: (x - mean) * rsqrt(variance + epsilon) * gamma + beta, as tf.nn writes it."""
        graph, at = self.graph, f"{name}/batchnorm"
        scale, offset = graph.positive(f"{name}/gamma", width), graph.weights(f"{name}/beta", (width,))
        mean, variance = (
            graph.weights(f"{name}/moving_mean", (width,)),
            graph.positive(f"{name}/moving_variance", width),
        )
        if self._switches:
            mean, variance = self._statistics(name, value, mean, variance)
        graph.const(f"{at}/add/y", 1e-3)
        graph.op(f"{at}/add", self._add, variance, f"{at}/add/y")
        graph.op(f"{at}/Rsqrt", "Rsqrt", f"{at}/add")
        graph.op(f"{at}/mul", "Mul", f"{at}/Rsqrt", scale)
        graph.op(f"{at}/mul_1", "Mul", value, f"{at}/mul")
        graph.op(f"{at}/mul_2", "Mul", mean, f"{at}/mul")
        graph.op(f"{at}/sub", "Sub", offset, f"{at}/mul_2")
        return graph.op(f"{at}/add_1", self._add, f"{at}/mul_1", f"{at}/sub")

    def _statistics(self, name: str, value: str, mean: str, variance: str) -> tuple[str, str]:
        """Those of the batch in training and the stored ones otherwise. The batch's are worked out before the branch
        (tf.nn.moments), so a car that drives has them in its graph too."""
        graph, at, keep = self.graph, f"{name}/moments", Attr.flag(True)
        graph.const(f"{at}/mean/reduction_indices", [0], "int32")
        graph.op(f"{at}/mean", "Mean", value, f"{at}/mean/reduction_indices", keep_dims=keep, Tidx=Attr.dtype(INT32))
        graph.op(f"{at}/StopGradient", "StopGradient", f"{at}/mean")
        graph.op(f"{at}/SquaredDifference", "SquaredDifference", value, f"{at}/StopGradient")
        graph.const(f"{at}/variance/reduction_indices", [0], "int32")
        graph.op(
            f"{at}/variance", "Mean", f"{at}/SquaredDifference", f"{at}/variance/reduction_indices",
            keep_dims=keep, Tidx=Attr.dtype(INT32),
        )  # fmt: skip
        chosen = []
        for suffix, what, stored in (("", "mean", mean), ("_1", "variance", variance)):
            graph.op(f"{at}/Squeeze{suffix}", "Squeeze", f"{at}/{what}", squeeze_dims=Attr.integers([0]))
            scope = f"{name}/{what}"
            condition = self._branches(scope)
            graph.op(f"{scope}/cond/Switch_1", "Switch", f"{at}/Squeeze{suffix}", condition)
            graph.op(f"{scope}/cond/Switch_2", "Switch", stored, condition)
            sources = (f"{scope}/cond/Switch_2", f"{scope}/cond/Switch_1:1")
            chosen.append(graph.op(f"{scope}/cond/Merge", "Merge", *sources, N=Attr.integer(2)))
        return chosen[0], chosen[1]

    def _dropped_out(self, name: str, value: str) -> str:
        """tf.layers.dropout: random in training, the identity otherwise."""
        graph, whole = self.graph, Attr.dtype(INT32)
        condition = self._branches(name)
        gate = (f"{name}/cond/switch_t",)
        graph.const(f"{name}/cond/dropout/keep_prob", 0.7, controls=gate)
        graph.op(f"{name}/cond/dropout/Shape/Switch", "Switch", value, condition)
        graph.op(f"{name}/cond/dropout/Shape", "Shape", f"{name}/cond/dropout/Shape/Switch:1", out_type=whole)
        graph.node(
            f"{name}/cond/dropout/random_uniform", "RandomUniform", [f"{name}/cond/dropout/Shape"],
            T=whole, dtype=Attr.dtype(FLOAT), seed=Attr.integer(0), seed2=Attr.integer(0),
        )  # fmt: skip
        kept, random = f"{name}/cond/dropout/keep_prob", f"{name}/cond/dropout/random_uniform"
        graph.op(f"{name}/cond/dropout/add", "Add", kept, random)
        graph.op(f"{name}/cond/dropout/Floor", "Floor", f"{name}/cond/dropout/add")
        graph.op(f"{name}/cond/dropout/div", "RealDiv", f"{name}/cond/dropout/Shape/Switch:1", kept)
        graph.op(f"{name}/cond/dropout/mul", "Mul", f"{name}/cond/dropout/div", f"{name}/cond/dropout/Floor")
        graph.op(f"{name}/cond/Identity/Switch", "Switch", value, condition)
        graph.op(f"{name}/cond/Identity", "Identity", f"{name}/cond/Identity/Switch")
        return graph.op(
            f"{name}/cond/Merge", "Merge", f"{name}/cond/Identity", f"{name}/cond/dropout/mul", N=Attr.integer(2)
        )

    # --- head

    def _rescale_gradients(self, state: str) -> str:
        graph, scope = self.graph, self._scope
        rescaler = graph.variable(f"{scope}/gradients_from_head_0-0_rescalers", np.float32(1.0))
        graph.const(f"{scope}/sub/x", 1.0)
        graph.op(f"{scope}/sub", "Sub", f"{scope}/sub/x", rescaler)
        one = {"axis": Attr.integer(0), "N": Attr.integer(1)}
        graph.op(f"{scope}/StopGradient/input", "Pack", state, **one)
        graph.op(f"{scope}/StopGradient", "StopGradient", f"{scope}/StopGradient/input")
        graph.op(f"{scope}/mul", "Mul", f"{scope}/sub", f"{scope}/StopGradient")
        graph.op(f"{scope}/mul_1/y", "Pack", state, **one)
        graph.op(f"{scope}/mul_1", "Mul", rescaler, f"{scope}/mul_1/y")
        return graph.op(f"{scope}/add", self._add, f"{scope}/mul", f"{scope}/mul_1")

    def _add_head(self, state: str, width: int) -> None:
        name = f"{self._scope}/{'sac_policy_head_0' if self._head == 'sac' else 'ppo_head_0'}"
        value = self._first(f"{name}/strided_slice", state, FLOAT)
        if self._head == "discrete":
            value = self._dense(f"{name}/policy_fc", value, width, self._actions)
            self.graph.op(f"{name}/policy", "Softmax", value)
            return
        if self._head == "sac":
            value = self.graph.op(f"{name}/dense/Relu", "Relu", self._dense(f"{name}/dense", value, width, 256))
            width = 256
        value = self._dense(f"{name}/policy_mean", value, width, 2)
        self.graph.op(f"{name}/policy", "Identity", value)


def coach_graph(
    sensors: list[str] | None = None, depth: str = SHALLOW, head: str = "discrete", actions: int = 5, **options: object
) -> bytes:
    """A frozen policy graph. ``head``: ``discrete``, ``continuous`` (both PPO) or ``sac``.

    Options: ``middleware`` (dense layers behind the embedders), ``agent`` (scope), ``activation``, ``batch_norm``,
    ``dropout``, ``padding``, ``modern`` (TensorFlow 2's names of operations), ``fused`` (what TensorFlow 1 calls batch
    normalisation of a picture), ``seed``; ``switches=False`` leaves out the branches that only training takes.
    """
    return CoachNetwork(sensors or ["FRONT_FACING_CAMERA"], depth, head, actions, **options).build()


def metadata_dict(
    sensors: list[str] | None = None, depth: str = SHALLOW, head: str = "discrete", actions: int = 5
) -> dict:
    """The metadata that belongs to :func:`coach_graph` of the same arguments."""
    if head == "discrete":
        space: object = [
            {"steering_angle": 30.0 - 60.0 * i / max(1, actions - 1), "speed": 2.0} for i in range(actions)
        ]
    else:
        space = {"steering_angle": {"low": -30.0, "high": 30.0}, "speed": {"low": 1.0, "high": 4.0}}
    return {
        "action_space": space,
        "action_space_type": "discrete" if head == "discrete" else "continuous",
        "sensor": sensors or ["FRONT_FACING_CAMERA"],
        "neural_network": depth,
        "training_algorithm": "sac" if head == "sac" else "clipped_ppo",
        "version": "4",
    }

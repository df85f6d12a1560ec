"""The deterministic policy of stable-baselines3 as ONNX, from the names and shapes of its weights.

It computes ``predict(observation, deterministic=True)``: pictures divided by 255, the features extractor, the layers
between, the head, for SAC and TD3 a tanh. A weight without a place in the policy is refused, because a network that is
rebuilt wrongly would drive badly.
Sources: stable_baselines3 2.9, common/policies.py, common/torch_layers.py, sac/policies.py, td3/policies.py,
dqn/policies.py.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from paddock.errors import UserFault
from paddock.network.wire import printable
from paddock.packages.inputs import MOST_FRAMES, InputSpec
from paddock.packages.metadata import NETWORKS, ModelMetadata
from paddock.simulator.camera.colours import colours

from ..trainer.network import BUILDS, NetworkLayout, to_onnx
from .facts import COMBINED, FLATTEN, NATURE, TORSO, Box, PolicyFacts

Array = Callable[[str], np.ndarray]
_OPSET, _IR_VERSION = 17, 8
_COLOURS = 3  # channels of a frame with observation="rgb", and of the front camera of deepracer-v0
_FRONT = "FRONT_FACING_CAMERA"
_STRIDES = {0: 4, 2: 2, 4: 1}  # of NatureCNN's convolutions, by their place
_SIMPLE = {"ReLU": "Relu", "Tanh": "Tanh", "Sigmoid": "Sigmoid", "ELU": "Elu", "Softplus": "Softplus", "Mish": "Mish"}
_SIMPLE["Hardswish"] = "HardSwish"


@dataclass(frozen=True)
class _Family:
    """Where a kind of policy keeps its weights. ``head`` is the layer of that name, or where ``hidden`` is the whole
    stack, ``""``: its last one. ``unused``: what is only needed for learning."""

    sign: str
    eyes: str
    hidden: str
    head: str
    activation: str
    squash: bool
    unused: tuple[str, ...]


_FAMILIES = (
    _Family(  # PPO, A2C
        *("action_net.weight", "pi_features_extractor.", "mlp_extractor.policy_net.", "action_net", "Tanh", False),
        ("value_net.", "mlp_extractor.value_net.", "vf_features_extractor.", "features_extractor.", "log_std"),
    ),
    _Family(  # SAC
        *("actor.mu.weight", "actor.features_extractor.", "actor.latent_pi.", "actor.mu", "ReLU", True),
        ("critic.", "critic_target.", "actor.log_std.", "log_ent_coef"),
    ),
    _Family(  # TD3, DDPG
        *("actor.mu.0.weight", "actor.features_extractor.", "actor.mu.", "", "ReLU", True),
        ("critic.", "critic_target.", "actor_target."),
    ),
    _Family(  # DQN
        *("q_net.q_net.0.weight", "q_net.features_extractor.", "q_net.q_net.", "", "ReLU", False),
        ("q_net_target.",),
    ),
)


def with_frame_stack(facts: PolicyFacts, metadata: ModelMetadata) -> ModelMetadata:
    """The metadata with the number of observations that VecFrameStack joined for this policy. Where they name a number
    already, or the policy observes something else than their sensors, they stay; :func:`rebuild` then compares.

    Raises UserFault ``sb3_frame_stack``, ``sb3_channels``.
    """
    boxes = _by_sensor(facts.observations, metadata)
    if metadata.frame_stack > 1 or set(boxes) != set(metadata.sensors):
        return metadata
    counts = {_stacked(spec, boxes[spec.sensor].shape) for spec in _as_seen(metadata)}
    if len(counts) > 1 or counts == {0}:
        return metadata
    (count,), sensor = counts, next(spec.sensor for spec in metadata.inputs if spec.is_picture)
    if count > MOST_FRAMES:
        raise UserFault("sb3_frame_stack", count=count, limit=MOST_FRAMES)
    may_be_colours = metadata.inputs[0].shape[-1] == 1 if set(facts.observations) == {""} else _FRONT in boxes
    if may_be_colours and not metadata.colour and count % _COLOURS == 0:
        raise UserFault("sb3_channels", count=count, sensor=sensor)
    return replace(metadata, frame_stack=count)


def rebuild(shapes: Mapping[str, tuple[int, ...]], array: Array, facts: PolicyFacts, metadata: ModelMetadata) -> bytes:
    """``shapes``: of all weights by name; ``array``: gives one as float32.

    Raises UserFault ``sb3_custom``, ``sb3_layer``, ``sb3_observation``, ``sb3_actions``.
    """
    family = next((one for one in _FAMILIES if one.sign in shapes), None)
    if family is None:
        raise UserFault("sb3_custom", what="a policy that is not one of PPO, A2C, SAC, TD3, DDPG and DQN")
    if not any(name.startswith(family.eyes) for name in shapes):
        family = replace(family, eyes="features_extractor.")  # before 2.0, and what all share
    policy = _Policy(family, shapes, array, facts, metadata)
    policy.refuse_others()
    return policy.onnx()


class _Policy:
    def __init__(
        self,
        family: _Family,
        shapes: Mapping[str, tuple[int, ...]],
        array: Array,
        facts: PolicyFacts,
        metadata: ModelMetadata,
    ) -> None:
        self._family, self._shapes, self._array = family, shapes, array
        self._facts, self._metadata = facts, metadata
        self._stack = self._linear_layers()
        self._head = family.head or self._stack.pop()
        self._extractor = self._find_extractor()
        self._nodes: list[onnx.NodeProto] = []
        self._weights: list[onnx.TensorProto] = []
        self._kept: set[str] = set()

    def refuse_others(self) -> None:
        """Refuse weights without a place in the policy, unless only learning needs them."""
        known = {f"{layer}.{part}" for layer in (*self._stack, self._head) for part in _PARTS}
        for name in self._shapes:
            if name not in known and not name.startswith((self._family.eyes, *self._family.unused)):
                raise _unknown(name)
        for name in sorted(known):
            self._shape(name)
        found = self._shape(f"{self._head}.weight")[0]
        if found != self._metadata.output_size:
            raise UserFault("sb3_actions", found=found, expected=self._metadata.output_size)

    def onnx(self) -> bytes:
        if self._extractor == TORSO:
            return self._of_our_trainer()
        sensors = [(spec.sensor, spec.channels_first) for spec in self._metadata.inputs]
        value = self._features()
        activation = self._facts.activation or self._family.activation
        for layer in self._stack:
            value = self._activated(activation, self._linear(layer, value))
        value = self._linear(self._head, value)
        if self._family.squash:
            value = self._node("Tanh", [value])
        ports = [*sensors, (value, (1, self._metadata.output_size))]
        *inputs, output = [helper.make_tensor_value_info(name, self._type_of(name), shape) for name, shape in ports]
        graph = helper.make_graph(self._nodes, "policy", inputs, [output], self._weights)
        opset = helper.make_opsetid("", _OPSET)
        return helper.make_model(graph, opset_imports=[opset], ir_version=_IR_VERSION).SerializeToString()

    def _type_of(self, port: str) -> int:
        """Bytes where they are looked up in the table of colours: a cast of floats would be a step, see
        :class:`paddock.network.bound.NetworkFacts`."""
        return TensorProto.UINT8 if self._metadata.colour and port == _FRONT else TensorProto.FLOAT

    # --- what is there

    def _shape(self, name: str) -> tuple[int, ...]:
        shape = self._shapes.get(name)
        if shape is None or len(shape) != (1 if name.endswith("bias") else 2):
            raise _unknown(name)
        return shape

    def _linear_layers(self) -> list[str]:
        """The dense layers of the stack in their order; an activation follows each."""
        prefix = self._family.hidden
        names = {name[len(prefix) :].partition(".")[0] for name in self._shapes if name.startswith(prefix)}
        layers = [f"{prefix}{2 * place}" for place in range(len(names))]
        for name in self._shapes:
            if name.startswith(prefix) and name.rpartition(".")[0] not in layers:
                raise _unknown(name)
        return layers

    def _find_extractor(self) -> str:
        parts = {name[len(self._family.eyes) :] for name in self._shapes if name.startswith(self._family.eyes)}
        tops = {part.partition(".")[0] for part in parts}
        kinds = {(): FLATTEN, ("cnn", "linear"): NATURE, ("extractors",): COMBINED, ("dense", "eyes"): TORSO}
        found = kinds.get(tuple(sorted(tops)))
        if found is None or (self._facts.extractor or found) != found:
            raise _unknown(self._family.eyes + sorted(parts)[0] if parts else self._family.eyes)
        return found

    # --- features

    def _features(self) -> str:
        specs = {spec.sensor: spec for spec in _as_seen(self._metadata)}
        boxes = _by_sensor(self._facts.observations, self._metadata)
        if set(boxes) != set(specs):
            found = ", ".join(name or "one picture" for name in boxes)
            raise UserFault("sb3_observation", found=printable(found), expected=", ".join(specs))
        for name, box in boxes.items():
            _check_box(specs[name], box)
        if self._extractor != COMBINED:
            (spec,) = specs.values()
            return self._seen(spec, self._family.eyes)
        seen = [self._seen(specs[name], f"{self._family.eyes}extractors.{name}.") for name in boxes]
        return seen[0] if len(seen) == 1 else self._node("Concat", seen, axis=1)

    def _seen(self, spec: InputSpec, prefix: str) -> str:
        value = spec.sensor
        if not spec.is_picture:
            return value
        if self._metadata.colour and spec.sensor == _FRONT:
            value = self._coloured(value, spec)
        if self._facts.normalize_images:
            value = self._node("Div", [value, self._constant("levels", np.float32(255.0))])
        if self._extractor == FLATTEN:
            return self._node("Flatten", [value], axis=1)
        channels, rows, columns = spec.channels_first[1:]
        for place, stride in _STRIDES.items():
            name = f"{prefix}cnn.{place}"
            shape = self._shapes.get(f"{name}.weight", ())
            if len(shape) != 4 or shape[1] != channels or shape[2] != shape[3]:
                raise _unknown(f"{name}.weight")
            channels, _, size, _ = shape
            rows, columns = (rows - size) // stride + 1, (columns - size) // stride + 1
            sources = [value, self._weight(f"{name}.weight"), self._weight(f"{name}.bias")]
            value = self._node("Conv", sources, kernel_shape=[size, size], strides=[stride, stride])
            value = self._node("Relu", [value])
        if self._shape(f"{prefix}linear.0.weight")[1] != channels * rows * columns:
            raise _unknown(f"{prefix}linear.0.weight")
        mine = [f"{prefix}{layer}.{part}" for layer in ("cnn.0", "cnn.2", "cnn.4", "linear.0") for part in _PARTS]
        for name in self._shapes:
            if name.startswith(prefix) and name not in mine:
                raise _unknown(name)
        return self._node("Relu", [self._linear(f"{prefix}linear.0", self._node("Flatten", [value], axis=1))])

    def _coloured(self, value: str, spec: InputSpec) -> str:
        """The picture in the colours that the policy saw, made of the grey one of a race."""
        places = self._node("Cast", [value], to=TensorProto.INT64)
        table = self._constant("colours", colours().astype(np.float32))
        frames = self._node("Transpose", [self._node("Gather", [table, places], axis=0)], perm=[0, 1, 4, 2, 3])
        shape = self._constant("coloured", np.array(spec.channels_first, np.int64))
        return self._node("Reshape", [frames, shape])

    def _of_our_trainer(self) -> bytes:
        """A policy of this site's own trainings, whose layout is known."""
        for layout in _layouts(self._metadata):
            names = _names_of_torso(layout, self._family.eyes, self._head)
            if all(self._shapes.get(names[key]) == shape for key, shape in layout.shapes.items()):
                torso = {name for name in self._shapes if name.startswith(self._family.eyes)}
                if not self._stack and torso <= set(names.values()):
                    weights = {key: self._array(names[key]) for key in layout.shapes}
                    return to_onnx(layout, weights, self._family.squash)
        expected = ", ".join(self._metadata.sensors)
        raise UserFault("sb3_observation", found="other sensors", expected=expected)

    # --- emitting

    def _node(self, kind: str, sources: Iterable[str], **attributes: Any) -> str:
        made = f"v{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, list(sources), [made], **attributes))
        return made

    def _constant(self, name: str, value: np.ndarray | np.float32) -> str:
        if name not in self._kept:
            self._kept.add(name)
            self._weights.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def _weight(self, name: str) -> str:
        if name not in self._shapes:
            raise _unknown(name)
        return self._constant(name, self._array(name))

    def _linear(self, layer: str, value: str) -> str:
        self._shape(f"{layer}.weight")
        return self._node("Gemm", [value, self._weight(f"{layer}.weight"), self._weight(f"{layer}.bias")], transB=1)

    def _activated(self, activation: str, value: str) -> str:
        if activation == "Identity":
            return value
        if activation == "SiLU":
            return self._node("Mul", [value, self._node("Sigmoid", [value])])
        if activation == "LeakyReLU":
            return self._node("LeakyRelu", [value], alpha=0.01)
        if activation not in _SIMPLE:
            raise UserFault("sb3_custom", what=f"activation_fn {printable(activation, 40)}")
        return self._node(_SIMPLE[activation], [value])


_PARTS = ("weight", "bias")


def _unknown(name: str) -> UserFault:
    return UserFault("sb3_layer", layer=printable(name))


def _as_seen(metadata: ModelMetadata) -> tuple[InputSpec, ...]:
    """The inputs as the policy saw them: with ``colour``, the front camera's channels are three times as many."""
    return tuple(
        spec.stacked(_COLOURS) if metadata.colour and spec.sensor == _FRONT else spec for spec in metadata.inputs
    )


def _by_sensor(boxes: Mapping[str, Box], metadata: ModelMetadata) -> Mapping[str, Box]:
    """The observations by sensor; a plain box belongs to the only sensor."""
    if set(boxes) == {""} and len(metadata.sensors) == 1:
        return {metadata.sensors[0]: boxes[""]}
    return boxes


def _check_box(spec: InputSpec, box: Box) -> None:
    shape = spec.channels_first[1:]
    if box.shape != shape or box.dtype != ("uint8" if spec.is_picture else "float32"):
        expected = f"{spec.sensor} {list(shape)} {'uint8' if spec.is_picture else 'float32'}"
        raise UserFault("sb3_observation", found=str(box), expected=expected)


def _stacked(spec: InputSpec, shape: tuple[int, ...]) -> int:
    """The number of observations joined by VecFrameStack in this shape, along its first or last axis; 0 for none."""
    for one, axis in ((spec.channels_first[1:], 0), (spec.shape, -1)):
        if len(shape) == len(one) and shape[axis] > one[axis] and not shape[axis] % one[axis]:
            rest = list(shape)
            rest[axis] = one[axis]
            if tuple(rest) == one:
                return shape[axis] // one[axis]
    return 0


def _layouts(metadata: ModelMetadata) -> Iterable[NetworkLayout]:
    """The layouts that our trainer may have built for this car: first those with the metadata's depth."""
    described = metadata.to_dict()
    for build in BUILDS:
        for network in (metadata.network, *NETWORKS):
            try:
                yield NetworkLayout.of({**described, "neural_network": network}, build)
            except LookupError:
                continue


def _names_of_torso(layout: NetworkLayout, eyes: str, head: str) -> dict[str, str]:
    """A layout's weights by their names in ``policy.pth``."""
    names = {}
    for number, sense in enumerate(layout.senses):
        layers = [f"conv{place}" for place in range(len(layout.convolutions))] if sense.spec.is_picture else ["dense"]
        for place, layer in enumerate(layers):
            names[f"{sense.name}.{layer}"] = f"{eyes}eyes.{number}.{2 * place}.weight"
            names[f"{sense.name}.{layer}_bias"] = f"{eyes}eyes.{number}.{2 * place}.bias"
    for key, layer in (("dense", f"{eyes}dense"), ("head", head)):
        names[key], names[f"{key}_bias"] = f"{layer}.weight", f"{layer}.bias"
    return names

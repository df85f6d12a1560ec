"""Parses ``model_metadata.json``, the field's own format with the field's own defaults."""

# Source: deepracer-simapp, markov/boto/s3/files/model_metadata.py and markov/multi_agent_coach/action_space_configs.py.
# Stricter than the original where it would crash or drive nonsense, never where a real file passes: numbers may be
# strings, unknown keys are ignored, and actions outside the car's range are kept, because the simulator clips them (to
# 30 degrees and 0.1-4 m/s).

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypedDict

from paddock.errors import UserFault
from paddock.network.wire import printable

from .inputs import (
    CAMERAS,
    IN_STEPS,
    LIDAR_BEAMS,
    LIDAR_DEFAULTS,
    MOST_FRAMES,
    SENSOR_NAMES,
    InputSpec,
    input_spec,
    lidar_settings,
)
from .limits import DEFAULT_LIMITS, PackageLimits

NETWORKS = (
    "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "DEEP_CONVOLUTIONAL_NETWORK",
    "DEEP_CONVOLUTIONAL_NETWORK_DEEP",
)
ALGORITHMS = ("clipped_ppo", "sac")
_ALIASES = {"ppo": "clipped_ppo", "clippedppo": "clipped_ppo", "soft_actor_critic": "sac"}
DISCRETE, CONTINUOUS = "discrete", "continuous"
MAX_ACTIONS = 500  # the field has no limit
_KEYS = ("steering_angle", "speed")
_VALUE_LIMIT = 1000.0
_DEPTH_LIMIT = 8
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"

Actions = tuple[Mapping[str, float], ...] | Mapping[str, Mapping[str, float]]


class MetadataDocument(TypedDict, total=False):
    """A checked ``model_metadata.json``. ``lidar_config`` and ``frame_stack``: only where they count."""

    action_space: list[dict[str, float]] | dict[str, dict[str, float]]
    action_space_type: str
    sensor: list[str]
    neural_network: str
    training_algorithm: str
    version: str
    lidar_config: dict[str, float]
    frame_stack: int


@dataclass(frozen=True)
class ModelMetadata:
    """A car's metadata, checked and with defaults filled in."""

    sensors: tuple[str, ...]  # as the file orders them
    action_space_type: str  # "discrete" or "continuous"
    actions: Actions  # discrete: ({"steering_angle": deg, "speed": m/s}, ...); continuous: {key: {"low", "high"}}
    network: str = NETWORKS[0]
    algorithm: str = ALGORITHMS[0]
    version: str = "2"
    lidar_config: Mapping[str, float] = field(default_factory=lidar_settings)
    frame_stack: int = 1  # how many observations the network reads at once: the newest and those before it
    colour: bool = False  # the policy saw the front camera in colour; for the rebuild of its network alone

    @property
    def output_size(self) -> int:
        """The number of the network's outputs: one for each action, or steering and speed."""
        return len(self.actions) if self.action_space_type == DISCRETE else len(_KEYS)

    @property
    def inputs(self) -> tuple[InputSpec, ...]:
        specs = (input_spec(sensor, self.lidar_config) for sensor in sorted(self.sensors))
        return tuple(spec.stacked(self.frame_stack) for spec in specs)

    def to_dict(self) -> MetadataDocument:
        return {
            **self._what_counts(),
            "sensor": list(self.sensors),
            "neural_network": self.network,
            "training_algorithm": self.algorithm,
            "version": self.version,
        }

    def canonical_json(self) -> bytes:
        """The part of a model's identity: action space, sensors and stacked frames, independent of layout and order."""
        return json.dumps(self._what_counts(), sort_keys=True, separators=(",", ":")).encode()

    def _what_counts(self) -> MetadataDocument:
        actions = self.actions
        data: MetadataDocument = {
            "action_space": (
                {key: dict(bounds) for key, bounds in actions.items()}
                if isinstance(actions, Mapping)
                else [dict(action) for action in actions]
            ),
            "action_space_type": self.action_space_type,
            "sensor": sorted(self.sensors),
        }
        if IN_STEPS in self.sensors:
            data["lidar_config"] = dict(self.lidar_config)
        if self.frame_stack > 1:
            data["frame_stack"] = self.frame_stack
        return data


def identity(onnx: bytes, metadata: ModelMetadata) -> str:
    """sha-256 of the canonical network, a zero byte, and the metadata that counts (action space and sensors)."""
    digest = hashlib.sha256(onnx)
    digest.update(b"\0" + metadata.canonical_json())
    return digest.hexdigest()


def parse_metadata(data: bytes, limits: PackageLimits = DEFAULT_LIMITS) -> ModelMetadata:
    """Parse ``model_metadata.json``. Raises UserFault with a code of the metadata section."""
    if len(data) > limits.metadata_bytes:
        raise UserFault("metadata_too_large", limit_kb=limits.metadata_bytes // 1000)
    raw = _load(data)
    if not isinstance(raw, dict):
        raise UserFault("metadata_not_object")
    raw = {key: value for key, value in raw.items() if value is not None}  # null is as good as missing
    kinds = (CONTINUOUS, DISCRETE) if isinstance(raw.get("action_space"), dict) else (DISCRETE, CONTINUOUS)
    kind = _choice(raw, "action_space_type", kinds, "metadata_action_space_type")
    algorithm = _choice(raw, "training_algorithm", ALGORITHMS, "metadata_algorithm")
    if algorithm == "sac" and kind != CONTINUOUS:
        raise UserFault("metadata_algorithm")
    version, sensors = _version_and_sensors(raw)
    return ModelMetadata(
        sensors=sensors,
        action_space_type=kind,
        actions=_actions(raw, kind),
        network=_network(raw),
        algorithm=algorithm,
        version=version,
        lidar_config=_lidar_config(raw),
        frame_stack=_frame_stack(raw),
        colour=raw.get("colour") is True,
    )


def _load(data: bytes) -> object:
    """Parse JSON without NaN, equal keys, deep nesting and huge integers."""
    try:
        text = data.removeprefix(_BYTE_ORDER_MARK).decode("utf-8")
    except UnicodeDecodeError as error:
        raise UserFault("metadata_not_json", line="line 1", problem="not UTF-8") from error
    _refuse_depth(text)
    try:
        return json.loads(
            text, parse_constant=_no_constant, parse_int=_bounded_int, object_pairs_hook=_unique_keys
        )  # fmt: skip
    except json.JSONDecodeError as error:
        raise UserFault("metadata_not_json", line=f"line {error.lineno}", problem=error.msg) from error
    except ValueError as error:
        raise UserFault("metadata_not_json", line="?", problem=printable(str(error))) from error


def _refuse_depth(text: str) -> None:
    """Count brackets before the parser recurses into them (those inside strings count too: none belong there)."""
    depth = 0
    for character in text:
        if character in "[{":
            depth += 1
            if depth > _DEPTH_LIMIT:
                raise UserFault("metadata_not_json", line="?", problem="nested too deeply")
        elif character in "]}":
            depth -= 1


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number in JSON")


def _bounded_int(digits: str) -> int:
    if len(digits) > 20:
        raise ValueError("a number has too many digits")
    return int(digits)


def _unique_keys(pairs: list[tuple[str, object]]) -> dict:
    result: dict[str, object] = {}
    for key, value in pairs:
        if key in result:
            raise UserFault("metadata_duplicate_key", key=printable(key, 40))
        result[key] = value
    return result


def _choice(raw: dict, key: str, known: tuple[str, ...], code: str) -> str:
    """A word of ``known``, by default the first; case and blanks do not matter, as in the original."""
    value = raw.get(key, "")
    if not isinstance(value, str):
        raise UserFault(code)
    word = value.strip().lower().replace(" ", "_").replace("-", "_") or known[0]
    word = _ALIASES.get(word, word)
    if word not in known:
        raise UserFault(code)
    return word


def _network(raw: dict) -> str:
    """The depth for the record; any other name counts as the field's default."""
    value = raw.get("neural_network", NETWORKS[0])
    if not isinstance(value, str):
        raise UserFault("metadata_network")
    word = value.strip().upper()
    return word if word in NETWORKS else NETWORKS[0]


def _version_and_sensors(raw: dict) -> tuple[str, tuple[str, ...]]:
    """Files without a sensor list are of version 1 and feed ``observation``."""
    if "version" in raw:
        version = _number(raw["version"])
        if version is None or not 1 <= version <= 6:
            raise UserFault("metadata_version")
    else:
        version = 2.0 if "sensor" in raw else 1.0
    sensors = raw.get("sensor", ["observation"]) if version >= 2 else ["observation"]
    if not isinstance(sensors, list) or not all(isinstance(sensor, str) for sensor in sensors):
        raise UserFault("metadata_sensor", sensor=printable(repr(sensors), 40))
    check_sensors(sensors)
    return f"{version:g}", tuple(sensors)


def check_sensors(sensors: Sequence[str]) -> None:
    """Raise UserFault("metadata_sensor" | "metadata_sensor_set") unless these are a camera and at most one lidar."""
    unknown = [sensor for sensor in sensors if sensor not in SENSOR_NAMES]
    if unknown:
        raise UserFault("metadata_sensor", sensor=printable(str(unknown[0]), 40))
    cameras = sum(sensor in CAMERAS for sensor in sensors)
    if cameras != 1 or len(sensors) > cameras + 1:
        raise UserFault("metadata_sensor_set")


def _actions(raw: dict, kind: str) -> Actions:
    space = raw.get("action_space")
    if space is None:
        raise UserFault("metadata_action_space_missing")
    if not isinstance(space, list if kind == DISCRETE else dict):
        raise UserFault("metadata_action_space_type")
    if isinstance(space, dict):
        return {key: _bounds(space.get(key), key) for key in _KEYS}
    if not space:
        raise UserFault("metadata_action_space_empty")
    if len(space) > MAX_ACTIONS:
        raise UserFault("metadata_too_many_actions", count=len(space), limit=MAX_ACTIONS)
    return tuple(_action(index, action) for index, action in enumerate(space))


def _action(index: int, action: object) -> dict[str, float]:
    if not isinstance(action, dict) or not all(key in action for key in _KEYS):
        raise UserFault("metadata_action", index=index)
    return {key: _value(action[key], key) for key in _KEYS}


def _bounds(bounds: object, key: str) -> dict[str, float]:
    if not isinstance(bounds, dict) or "low" not in bounds or "high" not in bounds:
        raise UserFault("metadata_action_range", key=key)
    low, high = _value(bounds["low"], key), _value(bounds["high"], key)
    if low >= high:
        raise UserFault("metadata_action_range", key=key)
    return {"low": low, "high": high}


def _value(raw: object, key: str) -> float:
    value = _number(raw)
    if value is None or abs(value) > _VALUE_LIMIT:
        raise UserFault("metadata_action_value", key=key)
    return value + 0.0  # no negative zero: it would be another identity


def _number(raw: object) -> float | None:
    """A finite number, or a string that holds one (real files write ``"version": "3"``)."""
    if isinstance(raw, bool) or not isinstance(raw, int | float | str) or (isinstance(raw, str) and len(raw) > 40):
        return None
    try:
        value = float(raw)
    except (ValueError, OverflowError):
        return None
    return value if math.isfinite(value) else None


def _lidar_config(raw: dict) -> dict[str, float]:
    given = raw.get("lidar_config", {})
    if not isinstance(given, dict):
        raise UserFault("metadata_lidar", key="lidar_config")
    config = lidar_settings()
    for key in LIDAR_DEFAULTS:
        if key not in given:
            continue
        value = _number(given[key])
        if value is None or (key != "clipping_dist" and value != int(value)):
            raise UserFault("metadata_lidar", key=key)
        config[key] = value if key == "clipping_dist" else int(value)
    if not 1 <= config["num_sectors"] <= LIDAR_BEAMS or LIDAR_BEAMS % config["num_sectors"]:
        raise UserFault("metadata_lidar_sectors", sectors=f"{config['num_sectors']:g}")
    if not 1 <= config["num_values_per_sector"] <= LIDAR_BEAMS:
        raise UserFault("metadata_lidar", key="num_values_per_sector")
    if not 0.15 <= config["clipping_dist"] <= 12.0:
        raise UserFault("metadata_lidar", key="clipping_dist")
    return config


def _frame_stack(raw: dict) -> int:
    value = _number(raw.get("frame_stack", 1))
    if value is None or value not in range(1, MOST_FRAMES + 1):
        raise UserFault("metadata_frame_stack", limit=MOST_FRAMES)
    return int(value)

"""Facts from ``data`` of a stable-baselines3 zip: spaces, layers, scale.

``save_to_zip_file`` writes JSON. What JSON cannot hold is a dict of ``:type:``, ``:serialized:`` (base64 of a pickle,
never decoded here) and the object's attributes as text, which is what is read.
Source: stable_baselines3/common/save_util.py (data_to_json).
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from paddock.errors import UserFault
from paddock.network.wire import printable

_LIBRARIES = ("stable_baselines3.", "sb3_contrib.")
_CLASS = re.compile(r"<class '([\w.]+)'>\Z")
# in a Dict: 'LIDAR': Box(0.15, 1.0, (64,), float32); in older ones an OrderedDict of pairs, or Dict(LIDAR:Box(...))
_BOX = re.compile(r"'?(\w{1,64})'?[:,]\s*Box\(([^()]{0,80})\(([\d, ]{0,40})\), (\w{1,16})\)")
_LISTED = 20_000
NATURE, FLATTEN, COMBINED, TORSO = "NatureCNN", "FlattenExtractor", "CombinedExtractor", "Torso"
_EXTRACTORS = {
    "stable_baselines3.common.torch_layers.NatureCNN": NATURE,
    "stable_baselines3.common.torch_layers.FlattenExtractor": FLATTEN,
    "stable_baselines3.common.torch_layers.CombinedExtractor": COMBINED,
    "training.trainer.torso.Torso": TORSO,
}


@dataclass(frozen=True)
class Box:
    """The shape and the type of an observation's part."""

    shape: tuple[int, ...]
    dtype: str

    def __str__(self) -> str:
        return f"{list(self.shape)} {self.dtype}"


@dataclass(frozen=True)
class PolicyFacts:
    """What cannot be seen in the shapes of the weights."""

    observations: Mapping[str, Box]  # by name, in the order in which they are joined; "" for a plain box
    activation: str | None  # the layers' between features and head; None: the policy's default
    normalize_images: bool
    extractor: str | None  # one of the above; None: the policy's default


def read_facts(data: bytes) -> PolicyFacts:
    """Raises UserFault ``sb3_unreadable``, ``sb3_custom``, ``sb3_action_space``."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise UserFault("sb3_unreadable", member="data")
    _refuse_custom_policy(document)
    _refuse_other_actions(_mapping(document, "action_space"))
    arguments = _mapping(document, "policy_kwargs")
    extractor = arguments.get("features_extractor_class")
    if document.get("use_sde") is True or arguments.get("use_sde") is True:
        raise UserFault("sb3_custom", what="use_sde=True")
    return PolicyFacts(
        observations=_observations(_mapping(document, "observation_space")),
        activation=_name_of_class(arguments["activation_fn"]) if "activation_fn" in arguments else None,
        normalize_images=arguments.get("normalize_images", True) is not False,
        extractor=None if extractor is None else _known_extractor(extractor),
    )


def _mapping(mapping: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = mapping.get(key)
    return value if isinstance(value, dict) else {}


def _refuse_custom_policy(document: Mapping[str, Any]) -> None:
    """Refuse an uploader's own policy class, which may do anything with its weights."""
    module = _mapping(document, "policy_class").get("__module__")
    if not isinstance(module, str) or not module.startswith(_LIBRARIES):
        raise UserFault("sb3_custom", what=f"policy {printable(str(module), 60)}")


def _refuse_other_actions(space: Mapping[str, Any]) -> None:
    """Refuse a box of actions other than [-1, 1], which would drive differently here."""
    if "Box" in str(space.get(":type:")) and (_ends(space.get("low")), _ends(space.get("high"))) != ({-1.0}, {1.0}):
        found = f"{printable(str(space.get('low')), 30)} to {printable(str(space.get('high')), 30)}"
        raise UserFault("sb3_action_space", found=found)


def _ends(text: Any) -> set[float]:
    try:
        return {float(word) for word in str(text)[:200].strip("[] ").replace(",", " ").split()}
    except ValueError:
        return set()


def _known_extractor(text: Any) -> str:
    found = _EXTRACTORS.get(_path_of_class(text))
    if found is None:
        raise UserFault("sb3_custom", what=f"features_extractor_class {printable(str(text), 60)}")
    return found


def _path_of_class(text: Any) -> str:
    found = _CLASS.match(text) if isinstance(text, str) else None
    return found[1] if found else ""


def _name_of_class(text: Any) -> str:
    path = _path_of_class(text)
    if not path.startswith("torch.nn."):
        raise UserFault("sb3_custom", what=f"activation_fn {printable(str(text), 60)}")
    return path.rpartition(".")[2]


def _observations(space: Mapping[str, Any]) -> dict[str, Box]:
    shape, dtype = space.get("_shape"), space.get("dtype")
    if isinstance(shape, list) and isinstance(dtype, str) and all(type(size) is int for size in shape):
        return {"": Box(tuple(shape), printable(dtype, 16))}
    listed = space.get("spaces")
    found = {}
    for name, _, sizes, kind in _BOX.findall(listed) if isinstance(listed, str) and len(listed) <= _LISTED else ():
        found[name] = Box(tuple(int(size) for size in sizes.replace(",", " ").split()), kind)
    if not found or not isinstance(listed, str) or len(found) != listed.count("Box("):
        raise UserFault("sb3_unreadable", member="data (observation_space)")
    return found

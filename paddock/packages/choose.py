"""Which files of an archive are the car: the network, its metadata and, of a training, which checkpoint.

An archive may be

- a car's, as the console and DeepRacer-for-Cloud write it: ``agent/model.pb`` and ``model_metadata.json``;
- a training's folder of either: ``model/model_<iteration>.pb`` beside checkpoints, logs, metrics and notes. The best
  one by ``deepracer_checkpoints.json`` is taken, else the last, else the one that the racer asks for;
- an ONNX file with its metadata, and the file of its weights where the exporter put them beside it;
- what ``model.save`` of stable-baselines3 writes: ``policy.pth`` and ``data``, of a dozen members.

Each may lie in folders. What is not needed is not read. Layouts: deepracer.md 1.1.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from paddock.errors import UserFault
from paddock.network.wire import printable

from .kinds import SB3, is_weights_file
from .limits import PackageLimits

METADATA = "model_metadata.json"
CHECKPOINTS = "deepracer_checkpoints.json"
_DATA = "data"  # what a zip of stable-baselines3 says of itself, as JSON
BEST, LAST, ASKED = "best", "last", "asked"

_CAR = re.compile(r"(.*/)?model\.pb\Z", re.DOTALL)
_ITERATION = re.compile(r"(?P<folder>.*/)?model_(?P<number>\d{1,9})\.pb\Z", re.DOTALL)
_ONNX = re.compile(r".*\.onnx\Z", re.IGNORECASE | re.DOTALL)
_POLICY = re.compile(r"(.*/)?policy\.pth\Z", re.DOTALL)
_PICKLED = re.compile(r"([^/]+/)?data\.pkl\Z")  # of torch.save and TorchScript: the zip's own name, then this
_RAW_CHECKPOINT = re.compile(
    r"(.*/)?(\.coach_checkpoint|checkpoint|.*\.ckpt(-\d+)?(\.(index|meta|data.*))?)\Z", re.DOTALL
)
_STEP = re.compile(r"(\d{1,9})_Step-\d{1,18}\.ckpt\Z")
_NAMED = 3  # files that a sentence names


@dataclass(frozen=True)
class Choice:
    """What to read. ``weights``: files beside an ONNX file that may hold its weights; of stable-baselines3 ``data``.
    ``kind``: a word of :mod:`.kinds`, empty where the network's own bytes tell. ``reason``: why this
    checkpoint (:data:`BEST`, :data:`LAST`, :data:`ASKED`), empty where there was nothing to choose."""

    network: str
    metadata: str | None
    weights: tuple[str, ...] = ()
    reason: str = ""
    kind: str = ""


def is_wanted_early(name: str) -> bool:
    """Whether the choice, or a car without a choice, needs this file: a stream keeps it in passing."""
    base = name.rsplit("/", 1)[-1]
    return base in (METADATA, CHECKPOINTS, _DATA)


def is_network(name: str) -> bool:
    """Whether a file of this name may be chosen as the network."""
    return any(pattern.match(name) for pattern in (_CAR, _ITERATION, _ONNX, _POLICY))


def choose(
    sizes: Mapping[str, int], read: Callable[[str], bytes], limits: PackageLimits, checkpoint: str = ""
) -> Choice:
    """Choose from the names in an archive. ``read`` gives the content of a small file; ``checkpoint`` is what the
    racer asks for: ``best``, ``last``, an iteration's number, or nothing.

    Raises UserFault ``model_missing``, ``several_networks``, ``duplicate_member``, ``training_folder_incomplete``,
    ``checkpoint_missing``, ``checkpoints_unreadable``, ``torch_file``.
    """
    reason = ""
    cars = [name for name in sizes if _CAR.match(name)]
    iterations = {name: int(found["number"]) for name in sizes if (found := _ITERATION.match(name))}
    onnx = [name for name in sizes if _ONNX.match(name)]
    policies = [name for name in sizes if _POLICY.match(name) and _folder(name) + _DATA in sizes]
    if len(policies) == 1 and not (checkpoint or cars or iterations or onnx):
        (network,) = policies
        folder = _folder(network)
        return Choice(network, _metadata_of(folder, sizes), (folder + _DATA,), kind=SB3)
    if checkpoint or (iterations and not cars and not onnx):
        network, reason = _iteration(iterations, sizes, read, limits, checkpoint)
    elif len(cars) + len(onnx) == 1:
        (network,) = cars + onnx
    elif cars or onnx:
        raise UserFault("several_networks", members=_list(cars + onnx))
    elif policies:
        raise UserFault("several_networks", members=_list(policies))
    elif any(_PICKLED.match(name) for name in sizes):
        raise UserFault("torch_file")
    elif any(_RAW_CHECKPOINT.match(name) for name in sizes):
        raise UserFault("training_folder_incomplete", missing="model/model_<iteration>.pb")
    else:
        raise UserFault("model_missing")
    folder = _folder(network)
    weights = [name for name in sizes if _folder(name) == folder and is_weights_file(name)] if network in onnx else []
    return Choice(network, _metadata_of(folder, sizes), tuple(weights), reason)


def _metadata_of(folder: str, sizes: Iterable[str]) -> str | None:
    """The metadata nearest to the network: in its folder or one above it, else the only one there is."""
    found = [name for name in sizes if name.rsplit("/", 1)[-1] == METADATA]
    while True:
        for place in (folder, f"{folder}custom_files/"):  # where DeepRacer-for-Cloud keeps what a training began with
            if place + METADATA in found:
                return place + METADATA
        if not folder:
            break
        folder = _folder(folder[:-1])
    if len(found) > 1:
        raise UserFault("duplicate_member", member=METADATA)
    return found[0] if found else None


def _iteration(
    iterations: Mapping[str, int],
    sizes: Mapping[str, int],
    read: Callable[[str], bytes],
    limits: PackageLimits,
    checkpoint: str,
) -> tuple[str, str]:
    """The frozen graph of one iteration of a training, and why this one."""
    if not iterations:
        raise UserFault("checkpoint_missing", checkpoint=printable(checkpoint, 20), found="none")
    folders = {_folder(name) for name in iterations}
    if len(folders) > 1:
        raise UserFault("several_networks", members=_list(iterations))
    (folder,) = folders
    by_number = {number: name for name, number in iterations.items()}
    if len(by_number) != len(iterations):  # model_7.pb and model_07.pb
        raise UserFault("several_networks", members=_list(iterations))
    last = by_number[max(by_number)]
    if checkpoint == LAST:
        return last, ASKED
    if checkpoint not in ("", BEST):
        number = int(checkpoint) if checkpoint.isascii() and checkpoint.isdigit() and len(checkpoint) < 10 else -1
        if number not in by_number:
            raise _no_checkpoint(checkpoint, by_number)
        return by_number[number], ASKED
    record = folder + CHECKPOINTS
    if record not in sizes:
        if checkpoint:
            raise UserFault("training_folder_incomplete", missing=f"model/{CHECKPOINTS}")
        return last, LAST
    if sizes[record] > limits.metadata_bytes:
        raise UserFault("checkpoints_unreadable", problem="too long")
    best = best_iteration(read(record))
    if best in by_number:
        return by_number[best], BEST
    if checkpoint:
        raise _no_checkpoint(str(best), by_number)
    return last, LAST


def best_iteration(data: bytes) -> int:
    """The iteration of the best checkpoint by ``deepracer_checkpoints.json``: ``{"best_checkpoint": {"name":
    "13_Step-25173.ckpt", ...}, ...}``. Raises UserFault ``checkpoints_unreadable``."""
    try:
        record = json.loads(data.decode("utf-8-sig"))
        name = record["best_checkpoint"]["name"]
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise UserFault("checkpoints_unreadable", problem="best_checkpoint is not there") from error
    found = _STEP.match(name) if isinstance(name, str) else None
    if found is None:
        raise UserFault("checkpoints_unreadable", problem=f"best_checkpoint is {printable(str(name), 40)}")
    return int(found[1])


def _no_checkpoint(asked: str, numbers: Iterable[int]) -> UserFault:
    return UserFault("checkpoint_missing", checkpoint=printable(asked, 20), found=_list(map(str, sorted(numbers)), 12))


def _folder(name: str) -> str:
    """The folder that a file lies in, with its slash; empty at the top."""
    return name[: name.rfind("/") + 1]


def _list(names: Iterable[str], limit: int = _NAMED) -> str:
    """Names for a sentence, the first few of many."""
    every = list(names)
    return ", ".join(printable(name, 60) for name in every[:limit]) + (", ..." if len(every) > limit else "")

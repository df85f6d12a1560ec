"""Chooses the files of an archive that make the car: network, metadata and checkpoint."""

# An archive may be
#
# - a car as the console and DeepRacer-for-Cloud write it: ``agent/model.pb`` and ``model_metadata.json``;
# - the folder of a training of either: ``model/model_<iteration>.pb`` beside checkpoints, logs, metrics and notes. The
#   best checkpoint by ``deepracer_checkpoints.json`` is taken, else the last, else the one that the racer requests;
# - an ONNX file with its metadata, and the file of its weights if the exporter wrote one;
# - the output of ``model.save`` of stable-baselines3: ``policy.pth`` and ``data``, of a dozen members;
# - another archive, alone or beside its metadata (:func:`inner_archive`).
#
# Each may lie in folders, and have names in other letters' case or with the copy numbers of browsers and file managers
# (``model_metadata (1).json``). Equal copies of one file count once. Other files are not read.

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from paddock.errors import UserFault
from paddock.network.wire import printable

from .kinds import SB3, has_network_name, is_weights_file
from .limits import PackageLimits

METADATA = "model_metadata.json"
CHECKPOINTS = "deepracer_checkpoints.json"
_DATA = "data"  # the description in a zip of stable-baselines3, as JSON
BEST, LAST, ASKED = "best", "last", "asked"

_FLAGS = re.IGNORECASE | re.DOTALL
_COPY = r"( ?\(\d{1,3}\)| - copy( \(\d{1,3}\))?| copy( \d{1,3})?)?"
_CAR = re.compile(rf"(.*/)?model{_COPY}\.pb\Z", _FLAGS)
_ITERATION = re.compile(rf"(.*/)?model_(?P<number>\d{{1,9}}){_COPY}\.pb\Z", _FLAGS)
_METADATA = re.compile(rf"(.*/)?model_metadata{_COPY}\.json\Z", _FLAGS)
_CHECKPOINTS = re.compile(rf"(.*/)?deepracer_checkpoints{_COPY}\.json\Z", _FLAGS)
_POLICY = re.compile(r"(.*/)?policy\.pth\Z", re.DOTALL)
_PICKLED = re.compile(r"([^/]+/)?data\.pkl\Z")  # of torch.save and TorchScript: the zip's own name, then this
_RAW_CHECKPOINT = re.compile(r"(.*/)?(\.coach_checkpoint|checkpoint|.*\.ckpt(-\d+)?(\.(index|meta|data.*))?)\Z", _FLAGS)
_ARCHIVE = re.compile(r".*\.(tar|tgz|tbz2?|txz|zip|gz|bz2|xz)\Z", _FLAGS)
_FOREIGN = (
    (re.compile(r".*\.tflite\Z", _FLAGS), "TensorFlow Lite"),
    (re.compile(r"(.*/)?saved_model\.pb\Z", _FLAGS), "TensorFlow SavedModel"),
    (re.compile(r".*\.(h5|hdf5|keras)\Z", _FLAGS), "Keras"),
    (re.compile(r".*\.safetensors\Z", _FLAGS), "safetensors"),
)
_STEP = re.compile(r"(\d{1,9})_Step-\d{1,18}\.ckpt\Z")
_NAMED = 3  # files that a sentence names
_COMPARED = 8  # copies of one network that are compared

Read = Callable[[str], bytes]


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
    """Whether a stream keeps this file for the choice while it passes."""
    return bool(_METADATA.match(name) or _CHECKPOINTS.match(name)) or name.rsplit("/", 1)[-1] == _DATA


def is_network(name: str) -> bool:
    return has_network_name(name) or any(pattern.match(name) for pattern in (_CAR, _ITERATION, _POLICY))


def inner_archive(sizes: Iterable[str]) -> str | None:
    """The only archive in an archive without a network."""
    names = list(sizes)
    archives = [name for name in names if _ARCHIVE.match(name)]
    return archives[0] if len(archives) == 1 and not any(is_network(name) for name in names) else None


def choose(sizes: Mapping[str, int], read: Read, limits: PackageLimits, checkpoint: str = "") -> Choice:
    """Choose from the names in an archive. ``read`` gives the content of a file; ``checkpoint`` is what the racer asks
    for: ``best``, ``last``, an iteration's number, or nothing.

    Raises UserFault ``model_missing``, ``network_format``, ``several_networks``, ``duplicate_member``,
    ``training_folder_incomplete``, ``checkpoint_missing``, ``checkpoints_unreadable``, ``torch_file``.
    """
    reason = ""
    cars = [name for name in sizes if _CAR.match(name)]
    iterations = {name: int(found["number"]) for name in sizes if (found := _ITERATION.match(name))}
    onnx = [name for name in sizes if has_network_name(name)]
    policies = [name for name in sizes if _POLICY.match(name) and _folder(name) + _DATA in sizes]
    if len(policies) == 1 and not (checkpoint or cars or iterations or onnx):
        (network,) = policies
        folder = _folder(network)
        return Choice(network, metadata_of(folder, sizes, read), (folder + _DATA,), kind=SB3)
    if checkpoint or (iterations and not cars and not onnx):
        network, reason = _iteration(iterations, sizes, read, limits, checkpoint)
    elif cars or onnx:
        network = _only_one(cars + onnx, sizes, read)
    elif policies:
        raise UserFault("several_networks", members=_list(policies))
    else:
        raise _nothing(sizes)
    folder = _folder(network)
    weights = [name for name in sizes if _folder(name) == folder and is_weights_file(name)] if network in onnx else []
    return Choice(network, metadata_of(folder, sizes, read), tuple(weights), reason)


def _nothing(sizes: Iterable[str]) -> UserFault:
    """The reason why an archive has no network, as far as its names show."""
    names = list(sizes)
    if any(_PICKLED.match(name) for name in names):
        return UserFault("torch_file")
    if any(_RAW_CHECKPOINT.match(name) for name in names):
        return UserFault("training_folder_incomplete", missing="model/model_<iteration>.pb")
    folded = {name.casefold() for name in names}
    for name in names:
        if name.casefold().endswith(".xml") and name.casefold()[:-4] + ".bin" in folded:
            return UserFault("network_format", format="OpenVINO", member=printable(name))
        for pattern, foreign_format in _FOREIGN:
            if pattern.match(name):
                return UserFault("network_format", format=foreign_format, member=printable(name))
    return UserFault("model_missing", found=list_names(names))


def _only_one(names: list[str], sizes: Mapping[str, int], read: Read) -> str:
    first, *others = names
    if others:
        same = len(names) <= _COMPARED and len({sizes[name] for name in names}) == 1
        if not same or len({hashlib.sha256(read(name)).digest() for name in names}) > 1:
            raise UserFault("several_networks", members=_list(names))
    return first


def metadata_of(folder: str, sizes: Mapping[str, int], read: Read) -> str | None:
    """The metadata nearest to the network: in its folder or one above it, else the only one there is."""
    found = [name for name in sizes if _METADATA.match(name)]
    while True:
        for place in (folder, f"{folder}custom_files/"):  # where DeepRacer-for-Cloud keeps what a training began with
            here = [name for name in found if _folder(name).casefold() == place.casefold()]
            named = [name for name in here if name[len(place) :].casefold() == METADATA]  # rather than a copy's number
            if here:
                return _only_metadata(named or here, read)
        if not folder:
            break
        folder = _folder(folder[:-1])
    return _only_metadata(found, read) if found else None


def _only_metadata(names: list[str], read: Read) -> str:
    if len(names) > 1 and (len(names) > _COMPARED or len({read(name) for name in names}) > 1):
        raise UserFault("duplicate_member", member=METADATA)
    return names[0]


def _iteration(
    iterations: Mapping[str, int], sizes: Mapping[str, int], read: Read, limits: PackageLimits, checkpoint: str
) -> tuple[str, str]:
    """The frozen graph of one iteration of a training, and the reason for the choice."""
    if not iterations:
        raise UserFault("checkpoint_missing", checkpoint=printable(checkpoint, 20), found="none")
    folders = {_folder(name) for name in iterations}
    if len(folders) > 1:
        return _only_one(list(iterations), sizes, read), LAST
    (folder,) = folders
    names: dict[int, list[str]] = {}
    for name, number in iterations.items():  # model_7.pb, model_07.pb and model_7 (1).pb
        names.setdefault(number, []).append(name)
    by_number = {number: _only_one(alike, sizes, read) for number, alike in names.items()}
    last = by_number[max(by_number)]
    if checkpoint == LAST:
        return last, ASKED
    if checkpoint not in ("", BEST):
        wanted = int(checkpoint) if checkpoint.isascii() and checkpoint.isdigit() and len(checkpoint) < 10 else -1
        if wanted not in by_number:
            raise _no_checkpoint(checkpoint, by_number)
        return by_number[wanted], ASKED
    record = next((name for name in sizes if _CHECKPOINTS.match(name) and _folder(name) == folder), None)
    if record is None:
        if checkpoint:
            raise UserFault("training_folder_incomplete", missing=f"model/{CHECKPOINTS}")
        return last, LAST
    if sizes[record] > limits.metadata_bytes:
        raise UserFault("checkpoints_unreadable", problem="too long")
    best = best_iteration(read(record))
    if best in by_number:
        return by_number[best], BEST
    if checkpoint:
        raise _no_checkpoint(BEST if best is None else str(best), by_number)
    return last, LAST


def best_iteration(data: bytes) -> int | None:
    """The iteration of the best checkpoint by ``deepracer_checkpoints.json``: ``{"best_checkpoint": {"name":
    "13_Step-25173.ckpt", ...}, ...}``; None where it names none, as before the first evaluation. Raises UserFault
    ``checkpoints_unreadable``."""
    try:
        record = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise UserFault("checkpoints_unreadable", problem="not JSON") from error
    if not isinstance(record, dict):
        raise UserFault("checkpoints_unreadable", problem="best_checkpoint is not there")
    best = record.get("best_checkpoint")
    name = best.get("name") if isinstance(best, dict) else best
    if name is None or name == "" or (isinstance(name, str) and not name.strip()):
        return None
    found = _STEP.match(name) if isinstance(name, str) else None
    if found is None:
        raise UserFault("checkpoints_unreadable", problem=f"best_checkpoint is {printable(str(name), 40)}")
    return int(found[1])


def _no_checkpoint(asked: str, numbers: Iterable[int]) -> UserFault:
    return UserFault("checkpoint_missing", checkpoint=printable(asked, 20), found=_list(map(str, sorted(numbers)), 12))


def _folder(name: str) -> str:
    """The folder of a file, with its slash; empty at the top."""
    return name[: name.rfind("/") + 1]


def list_names(names: Iterable[str]) -> str:
    """The content of an upload, for a sentence."""
    return _list(names, 5) or "-"


def _list(names: Iterable[str], limit: int = _NAMED) -> str:
    """Names for a sentence, the first few of many."""
    every = list(names)
    return ", ".join(printable(name, 60) for name in every[:limit]) + (", ..." if len(every) > limit else "")

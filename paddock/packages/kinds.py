"""The registry of upload formats, and the detection of a file's type by its first bytes."""

# File names decide only inside archives.

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from .limits import PackageLimits
    from .metadata import ModelMetadata

TENSORFLOW, ONNX, SB3 = "tensorflow", "onnx", "sb3"
GZIP, XZ, BZIP2, ZIP, TAR, JSON, BINARY = "gzip", "xz", "bzip2", "zip", "tar", "json", "binary"
COMPRESSED = (GZIP, XZ, BZIP2)
ARCHIVES = (*COMPRESSED, ZIP, TAR)
CAR, OPENVINO = "car", "openvino"  # what a model is written as for others
EXPORTS = (CAR, OPENVINO)
HEAD = 512  # bytes that :func:`sniff` and :func:`network_kind` want to see

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
# compiled at first use: most commands read no file
_BZIP2 = rb"BZh[1-9](1AY&SY|\x17rE8P\x90)"  # a first block, or the end of an empty stream
_PICKLED = rb"\x80[\x02-\x05]"  # a pickle of protocol 2 and later: what torch wrote before its zips
# torch writes car.onnx.data, onnx's own helper any name; optimum model.onnx_data
_WEIGHTS = r"(?is).*(\.onnx\.data|\.data|\.onnx_data|\.bin|\.weights)\Z"


def sniff(head: bytes) -> str:
    """One of :data:`ARCHIVES`, :data:`JSON`, or :data:`BINARY` (perhaps a network)."""
    if head.startswith(b"\x1f\x8b"):
        return GZIP
    if head.startswith(b"\xfd7zXZ\0"):
        return XZ
    if re.match(_BZIP2, head):
        return BZIP2
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06", b"PK\x07\x08")):
        return ZIP
    if head[257:262] == b"ustar":
        return TAR
    if head.removeprefix(_BYTE_ORDER_MARK).lstrip().startswith((b"{", b"[")):
        return JSON
    return BINARY


def network_kind(model: bytes) -> str | None:
    """The code of a file's format by its bytes; None for a file that cannot be a network."""
    return next((one.code for one in FORMATS.values() if model and one.begins(model)), None)


def network_suffixes() -> tuple[str, ...]:
    return tuple(one.suffix for one in FORMATS.values() if one.suffix)


def has_network_name(name: str) -> bool:
    """Whether a file of an archive is a network by its suffix alone."""
    return name.lower().endswith(tuple(one.suffix for one in FORMATS.values() if one.by_suffix))


class UploadFormat(NamedTuple):
    """A format of networks that may be uploaded. To add one, add it to :data:`FORMATS`.

    ``code``: in rows and the API; ``label``: on pages; ``text``: in the description of the API, if longer; ``begins``:
    whether these bytes may begin such a file; ``suffix``: of its name; ``by_suffix``: each file of an archive with the
    suffix is a network, otherwise :mod:`.choose` has the names; ``weights``: files beside it may contain its weights;
    ``to_onnx``: converts it (:mod:`.admission` imports its modules before the lock), None for ONNX and for a format
    with a separate process in ``evaluation.garage.admission.PROCESSES``. ``no_process``: the code of a site without
    that process; ``at_home``: of the racers' package.
    """

    code: str
    label: str
    text: str = ""
    begins: Callable[[bytes], bool] = lambda model: False
    suffix: str = ""
    by_suffix: bool = False
    weights: bool = False
    to_onnx: Callable[[bytes, ModelMetadata, PackageLimits], bytes] | None = None
    no_process: str = ""
    at_home: str = ""


def _begins_graph(model: bytes) -> bool:
    """A GraphDef begins with its first node (field 1, length-delimited)."""
    return model[0] == 0x0A and len(model) > 1 and model[1] not in b"\r\n"


def _begins_onnx(model: bytes) -> bool:
    """Field 1 is a varint, and the other fields are numbered up to 26; text, pictures and programs begin with none."""
    fields = (0x08, 0x12, 0x1A, 0x22, 0x28, 0x32, 0x3A, 0x42)
    return model[0] in fields and not model.startswith((b"BZ", b'"', b"(", b":"))


def _graph_to_onnx(graph: bytes, metadata: ModelMetadata, limits: PackageLimits) -> bytes:
    from .tensorflow import convert

    return convert(graph, metadata.inputs, limits)


FORMATS: dict[str, UploadFormat] = {
    one.code: one
    for one in (
        UploadFormat(ONNX, "ONNX", begins=_begins_onnx, suffix=".onnx", by_suffix=True, weights=True),
        UploadFormat(
            TENSORFLOW,
            "TensorFlow",
            "frozen TensorFlow graph",
            begins=_begins_graph,
            suffix=".pb",
            to_onnx=_graph_to_onnx,
        ),
        UploadFormat(
            SB3,
            "stable-baselines3",
            "zip of stable-baselines3",
            no_process="sb3_needs_torch",
            at_home="sb3_at_home",
        ),
    )
}


def format_texts() -> list[tuple[str, str]]:
    return [(one.code, one.text or one.label) for one in FORMATS.values()]


def foreign_format(head: bytes) -> str:
    """The name of a network's format that cannot be read here, by a file's first bytes; empty for any other file."""
    if head[4:8] == b"TFL3":
        return "TensorFlow Lite"
    if head.startswith(b"\x89HDF\r\n\x1a\n"):
        return "Keras (HDF5)"
    if re.match(rb"(\xef\xbb\xbf)?\s*(<\?xml[^>]*>\s*)?<net\s", head):
        return "OpenVINO"
    return ""


def is_pickle(head: bytes) -> bool:
    """Whether a file begins as a pickle: Python objects, which are never opened."""
    return re.match(_PICKLED, head) is not None


def is_weights_file(name: str) -> bool:
    """Whether a file of this name may contain the external weights of an ONNX file, whatever its content."""
    return re.match(_WEIGHTS, name) is not None

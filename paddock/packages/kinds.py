"""What an uploaded file is, by its first bytes. The one place that knows; names only decide inside of archives."""

from __future__ import annotations

import re

TENSORFLOW, ONNX, SB3 = "tensorflow", "onnx", "sb3"
GZIP, XZ, BZIP2, ZIP, TAR, JSON, BINARY = "gzip", "xz", "bzip2", "zip", "tar", "json", "binary"
COMPRESSED = (GZIP, XZ, BZIP2)
ARCHIVES = (*COMPRESSED, ZIP, TAR)
CAR, OPENVINO = "car", "openvino"  # what a model is written as for others
EXPORTS = (CAR, OPENVINO)
HEAD = 512  # bytes that :func:`sniff` and :func:`network_kind` want to see

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_BZIP2 = re.compile(rb"BZh[1-9](1AY&SY|\x17rE8P\x90)")  # a first block, or the end of an empty stream
_PICKLED = re.compile(rb"\x80[\x02-\x05]")  # a pickle of protocol 2 and later: what torch wrote before its zips
# torch writes car.onnx.data, onnx's own helper whatever it is told; optimum model.onnx_data
_WEIGHTS = re.compile(r".*(\.onnx\.data|\.data|\.onnx_data|\.bin|\.weights)\Z", re.IGNORECASE | re.DOTALL)


def sniff(head: bytes) -> str:
    """One of :data:`ARCHIVES`, :data:`JSON`, or :data:`BINARY` (perhaps a network)."""
    if head.startswith(b"\x1f\x8b"):
        return GZIP
    if head.startswith(b"\xfd7zXZ\0"):
        return XZ
    if _BZIP2.match(head):
        return BZIP2
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06", b"PK\x07\x08")):
        return ZIP
    if head[257:262] == b"ustar":
        return TAR
    if head.removeprefix(_BYTE_ORDER_MARK).lstrip().startswith((b"{", b"[")):
        return JSON
    return BINARY


def network_kind(model: bytes) -> str | None:
    """Tell a GraphDef from an ONNX model by its first field; None for what cannot be either.

    A GraphDef begins with its first node (field 1, length-delimited). An ONNX model's field 1 is a varint, and its
    other fields are numbered up to 26; text, pictures and programs begin with no such field.
    """
    if not model:
        return None
    first = model[0]
    if first == 0x0A:
        return TENSORFLOW if len(model) > 1 and model[1] not in b"\r\n" else None
    if first in (0x08, 0x12, 0x1A, 0x22, 0x28, 0x32, 0x3A, 0x42) and not model.startswith((b"BZ", b'"', b"(", b":")):
        return ONNX
    return None


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
    return _PICKLED.match(head) is not None


def is_weights_file(name: str) -> bool:
    """Whether a file of this name may hold the weights that an ONNX file keeps outside of itself. By name only: the
    file itself is nothing but numbers, and may begin like anything."""
    return _WEIGHTS.match(name) is not None

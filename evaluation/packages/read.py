"""From uploaded files to a network's bytes and its metadata's bytes: bounded, by content, nothing extracted to disk."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO

from faults import UserFault

from .archive_tar import gzip_chunks, plain_chunks, read_tar
from .archive_zip import read_zip
from .limits import DEFAULT_LIMITS, PackageLimits
from .members import METADATA, MODEL

TENSORFLOW, ONNX = "tensorflow", "onnx"

_CHUNK = 64 * 1024
_HEAD = 512
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class UploadPart:
    """One uploaded file. ``name`` is the sender's and only decides nothing: files are told apart by content."""

    name: str
    stream: BinaryIO


@dataclass(frozen=True)
class RawPackage:
    """What was in the upload, unread: ``kind`` is ``"tensorflow"`` (a GraphDef) or ``"onnx"``."""

    kind: str
    model: bytes
    metadata_json: bytes
    source_sha256: str  # of the file as sent; of the digests of model and metadata when they came as two files


class _Metered:
    """A stream that counts, hashes and stops at the upload's limit (shared by all parts)."""

    def __init__(self, stream: BinaryIO, meter: _Meter) -> None:
        self._stream = stream
        self._meter = meter
        self.digest = hashlib.sha256()

    def read(self, size: int) -> bytes:
        chunk = self._stream.read(size)
        self._meter.add(len(chunk))
        self.digest.update(chunk)
        return chunk

    def read_exactly(self, size: int) -> bytes:
        """``size`` bytes, or fewer at the end of the stream."""
        parts, missing = [], size
        while missing and (chunk := self.read(missing)):
            parts.append(chunk)
            missing -= len(chunk)
        return b"".join(parts)

    def read_all(self, head: bytes) -> bytes:
        parts = [head]
        while chunk := self.read(_CHUNK):
            parts.append(chunk)
        return b"".join(parts)


class _Meter:
    def __init__(self, limits: PackageLimits) -> None:
        self._left = limits.upload_bytes
        self._limits = limits

    def add(self, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise UserFault("too_large", limit_mb=self._limits.upload_bytes >> 20)


def read_upload(files: Sequence[UploadPart], limits: PackageLimits = DEFAULT_LIMITS) -> RawPackage:
    """Read one archive (.tar.gz, .tar, .zip), or a network and its ``model_metadata.json`` as two files.

    Memory stays below the upload limit plus the network's size. Raises UserFault with a code of the upload section.
    """
    if not files:
        raise UserFault("empty")
    if len(files) > 2:
        raise UserFault("upload_parts")
    meter = _Meter(limits)
    parts = [_Metered(part.stream, meter) for part in files]
    heads = [part.read_exactly(_HEAD) for part in parts]
    if not all(heads):
        raise UserFault("empty")
    kinds = [_sniff(head) for head in heads]
    if len(parts) == 1 and kinds[0] in ("gzip", "zip", "tar"):
        members = _read_archive(kinds[0], heads[0], parts[0], limits)
        digest = parts[0].digest.hexdigest()
    else:
        members = _read_loose(kinds, heads, parts)
        digest = _pair_digest(members)
    return _package(members, digest, limits)


def _sniff(head: bytes) -> str:
    """What a file is, by its first bytes: ``gzip``, ``zip``, ``tar``, ``json`` or ``binary`` (perhaps a network)."""
    if head.startswith(b"\x1f\x8b"):
        return "gzip"
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06", b"PK\x07\x08")):
        return "zip"
    if head[257:262] == b"ustar":
        return "tar"
    if head.removeprefix(_BYTE_ORDER_MARK).lstrip().startswith((b"{", b"[")):
        return "json"
    return "binary"


def _read_archive(kind: str, head: bytes, part: _Metered, limits: PackageLimits) -> dict[str, bytes]:
    if kind == "zip":
        return read_zip(part.read_all(head), limits)
    chunks = gzip_chunks if kind == "gzip" else plain_chunks
    members = read_tar(chunks(head, part, limits), limits)
    part.read_all(b"")  # whatever follows the archive counts and is part of the digest
    return members


def _read_loose(kinds: list[str], heads: list[bytes], parts: list[_Metered]) -> dict[str, bytes]:
    """Loose files: JSON is the metadata, anything else the network."""
    roles = [METADATA if kind == "json" else MODEL for kind in kinds]
    if len(parts) == 2 and (roles[0] == roles[1] or not {"binary", "json"}.issuperset(kinds)):
        raise UserFault("upload_parts")
    return {role: part.read_all(head) for role, part, head in zip(roles, parts, heads, strict=True)}


def _pair_digest(members: dict[str, bytes]) -> str:
    whole = hashlib.sha256()
    for role in (MODEL, METADATA):
        whole.update(hashlib.sha256(members.get(role, b"")).digest())
    return whole.hexdigest()


def _package(members: dict[str, bytes], digest: str, limits: PackageLimits) -> RawPackage:
    model, metadata = members.get(MODEL), members.get(METADATA)
    if model is not None:
        kind = network_kind(model)
        if kind is None:
            raise UserFault("not_a_model") if model else UserFault("empty")
        if len(model) > limits.model_bytes:
            raise UserFault("model_too_large", limit_mb=limits.model_bytes >> 20)
    if metadata is None:
        raise UserFault("metadata_missing" if model is not None else "model_missing")
    if len(metadata) > limits.metadata_bytes:
        raise UserFault("metadata_too_large", limit_kb=limits.metadata_bytes // 1000)
    if model is None:
        raise UserFault("model_missing")
    return RawPackage(kind, model, metadata, digest)


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

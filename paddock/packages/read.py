"""Reads the network and the metadata from uploaded files, within bounds and without extraction to disk."""

# :mod:`.kinds` detects the type of a file; :mod:`.choose` selects the files of an archive.

import hashlib
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, BinaryIO

from paddock.errors import UserFault
from paddock.network.wire import printable

from . import choose, kinds
from .archive_tar import TarArchive
from .archive_zip import ZipArchive
from .compressed import Unpacked, read_exactly
from .kinds import ONNX, SB3, TENSORFLOW, network_kind
from .limits import DEFAULT_LIMITS, PackageLimits

__all__ = ["ONNX", "SB3", "TENSORFLOW", "RawPackage", "UploadPart", "network_kind", "read_upload"]

_CHUNK = 64 * 1024
_NESTED = 2  # how deep archives may lie in each other
_NETWORK, _METADATA, _WEIGHTS = "network", "metadata", "weights"


@dataclass(frozen=True)
class UploadPart:
    """One uploaded file. ``name`` is the sender's; of it only the ending counts, and only for weights beside an ONNX
    file: all others are recognised by their content. An archive's ``stream`` must be seekable."""

    name: str
    stream: BinaryIO


@dataclass(frozen=True)
class RawPackage:
    """What was in the upload, unread. ``kind`` is one of :mod:`.kinds`: a GraphDef, an ONNX file, or the
    ``policy.pth`` of stable-baselines3."""

    kind: str
    model: bytes
    metadata_json: bytes
    source_sha256: str  # of the file as sent; of the digests of its parts when they came as several files
    weights: dict[str, bytes] = field(default_factory=dict)  # files beside an ONNX file that may hold its weights
    # notes for the racer
    taken: str = field(default="", compare=False)  # the network's name in the archive
    reason: str = field(default="", compare=False)  # why this checkpoint: a word of :mod:`.choose`
    ignored: tuple[str, ...] = field(default=(), compare=False)  # files of the archive that were not needed


class _Metered:
    """A stream that counts, hashes and stops at the upload's limit. ``meter``: the bytes left to all parts."""

    def __init__(self, part: UploadPart, meter: list[int], limits: PackageLimits) -> None:
        self.name, self.stream = part.name, part.stream
        self._meter, self._limits = meter, limits
        self.digest = hashlib.sha256()
        self.size = 0

    def read(self, size: int) -> bytes:
        chunk = self.stream.read(size)
        self._meter[0] -= len(chunk)
        if self._meter[0] < 0:
            raise UserFault("too_large", limit_mb=self._limits.upload_bytes >> 20)
        self.size += len(chunk)
        self.digest.update(chunk)
        return chunk

    def read_all(self, head: bytes, limit: int) -> bytes:
        """``head`` and the rest of the stream; of more than ``limit`` bytes only somewhat more than it."""
        whole = io.BytesIO()  # gives its bytes away without a copy
        whole.write(head)
        while whole.tell() <= limit and (chunk := self.read(_CHUNK)):
            whole.write(chunk)
        return whole.getvalue()

    def exhaust(self) -> None:
        while self.read(_CHUNK):
            pass


def read_upload(
    files: Sequence[UploadPart], limits: PackageLimits = DEFAULT_LIMITS, *, checkpoint: str = ""
) -> RawPackage:
    """Read one archive (.zip, .tar; the latter as .gz, .xz or .bz2, too), with ``model_metadata.json`` beside it if it
    has none; or loose files: a network, its metadata, and the weights of an ONNX file that keeps them outside.

    ``checkpoint``: which one of a training's folder, see :func:`.choose.choose`. Memory stays below twice the network's
    size. Raises UserFault with a code of the upload section.
    """
    if not files:
        raise UserFault("empty")
    if len(files) > limits.parts:
        raise UserFault("upload_parts")
    meter = [limits.upload_bytes]
    parts = [_Metered(part, meter, limits) for part in files]
    heads = [read_exactly(part, kinds.HEAD) for part in parts]
    if not all(heads):
        raise UserFault("empty")
    roles = _roles(parts, heads)
    if any(role in kinds.ARCHIVES for role in roles):
        return _read_packed(roles, parts, heads, limits, checkpoint)
    return _read_loose(roles, parts, heads, limits)


def _roles(parts: list[_Metered], heads: list[bytes]) -> list[str]:
    """The role of each part: an archive's kind, or the purpose of a loose file."""
    roles = []
    kinds_by_content = [kinds.sniff(head) for head in heads]
    named = [kinds.is_weights_file(part.name) for part in parts]
    # beside a network only: alone or with its metadata, a file of such a name is the network
    accompany = any(not is_named and kind != kinds.JSON for is_named, kind in zip(named, kinds_by_content, strict=True))
    for is_named, kind in zip(named, kinds_by_content, strict=True):
        if is_named and accompany:
            roles.append(_WEIGHTS)
        elif kind in kinds.ARCHIVES:
            roles.append(kind)
        else:
            roles.append(_METADATA if kind == kinds.JSON else _NETWORK)
    return roles


def _read_packed(
    roles: list[str], parts: list[_Metered], heads: list[bytes], limits: PackageLimits, checkpoint: str
) -> RawPackage:
    """One archive, and perhaps the metadata that it lacks."""
    if roles not in ([roles[0]], [roles[0], _METADATA], [_METADATA, roles[-1]]):
        raise UserFault("upload_parts")
    place = 1 if roles[0] == _METADATA else 0
    part, head = parts[place], heads[place]
    archive = _open(roles[place], head, part, limits)
    part.exhaust()  # whatever follows the archive counts and is part of the digest
    found = _find(archive, part.size, limits, checkpoint)
    digest = part.digest.hexdigest()
    metadata = found.metadata
    if len(parts) == 2:
        if metadata is not None:
            raise UserFault("upload_parts")
        metadata = parts[1 - place].read_all(heads[1 - place], limits.metadata_bytes)
        digest = _joint_digest(bytes.fromhex(digest), hashlib.sha256(metadata).digest())
    choice = found.choice
    return _package(
        found.members[choice.network],
        metadata,
        limits,
        found=choose.list_names(found.names),
        source_sha256=digest,
        weights={name.rsplit("/", 1)[-1]: found.members[name] for name in choice.weights},
        taken=choice.network,
        reason=choice.reason,
        kind=choice.kind,
        ignored=tuple(name for name in found.names if name not in found.members),
    )


@dataclass(frozen=True)
class _Found:
    """The car in an archive: its files by name (``members``), all names, the metadata where there is any."""

    choice: choose.Choice
    members: dict[str, bytes]
    names: list[str]
    metadata: bytes | None


class _OneFile:
    """A network that is compressed without an archive, such as ``model.onnx.gz``."""

    def __init__(self, name: str, content: bytes) -> None:
        self.sizes = {name: len(content)}
        self._content = content

    def read(self, names: Iterable[str]) -> dict[str, bytes]:
        return dict.fromkeys(names, self._content)


_Archive = TarArchive | ZipArchive | _OneFile


def _find(archive: _Archive, packed: int, limits: PackageLimits, checkpoint: str, depth: int = 0) -> _Found:
    """``packed``: the size of the upload itself, the base of every ratio."""

    def read(name: str) -> bytes:
        return archive.read([name])[name]

    sizes = archive.sizes
    inner = choose.inner_archive(sizes) if depth < _NESTED else None
    if inner is not None:
        beside = choose.metadata_of("", sizes, read)
        if beside is not None and sizes[beside] > limits.metadata_bytes:
            raise _metadata_too_large(limits)
        metadata = None if beside is None else read(beside)
        found = _find_inner(inner, archive, packed, limits, checkpoint, depth)
        names = [*(name for name in sizes if name not in (inner, beside)), *found.names]
        return replace(found, names=names, metadata=metadata if found.metadata is None else found.metadata)
    choice = choose.choose(sizes, read, limits, checkpoint)
    wanted = [choice.network, *choice.weights]
    if sum(sizes[name] for name in wanted) > limits.model_bytes:
        raise UserFault("model_too_large", limit_mb=limits.model_bytes >> 20)
    if choice.metadata is not None:
        if sizes[choice.metadata] > limits.metadata_bytes:
            raise _metadata_too_large(limits)
        wanted.append(choice.metadata)
    members = archive.read(wanted)
    return _Found(choice, members, list(sizes), members.get(choice.metadata or ""))


def _find_inner(name: str, outer: _Archive, packed: int, limits: PackageLimits, checkpoint: str, depth: int) -> _Found:
    """The car in an archive's only archive, within the upload's remaining limits."""
    if outer.sizes[name] > limits.model_bytes:
        raise UserFault("expanded_size")
    content = outer.read([name])[name]
    allowed = max(limits.expansion_free_bytes, limits.expansion_ratio * packed)
    within = replace(limits, expanded_bytes=min(limits.expanded_bytes, allowed))
    part = _Metered(UploadPart(name, io.BytesIO(content)), [limits.upload_bytes], limits)
    head = read_exactly(part, kinds.HEAD)
    kind = kinds.sniff(head)
    if kind not in kinds.ARCHIVES:
        raise UserFault("model_missing", found=choose.list_names(outer.sizes))
    return _find(_open(kind, head, part, within), packed, within, checkpoint, depth + 1)


def _metadata_too_large(limits: PackageLimits) -> UserFault:
    return UserFault("metadata_too_large", limit_kb=limits.metadata_bytes // 1000)


def _open(kind: str, head: bytes, part: _Metered, limits: PackageLimits) -> _Archive:
    if kind == kinds.ZIP:
        part.exhaust()
        return ZipArchive(part.stream, limits)
    unpacked = Unpacked(head, part, limits)
    if unpacked.kind == kinds.ZIP:
        return ZipArchive(io.BytesIO(_whole(unpacked, limits)), limits)
    if foreign := kinds.foreign_format(unpacked.head):
        raise UserFault("network_format", format=foreign, member=printable(part.name))
    if unpacked.kind == kinds.BINARY and (network := network_kind(unpacked.head)):
        return _OneFile(f"model{kinds.FORMATS[network].suffix}", _whole(unpacked, limits))

    def again() -> Iterator[bytes]:
        part.stream.seek(0)
        return Unpacked(part.stream.read(kinds.HEAD), part.stream, limits).chunks

    return TarArchive(unpacked.chunks, again, limits)


def _whole(unpacked: Unpacked, limits: PackageLimits) -> bytes:
    """A network, or a zip that was compressed once more, as a whole."""
    whole = io.BytesIO()
    for chunk in unpacked.chunks:
        whole.write(chunk)
        if whole.tell() > limits.model_bytes:
            raise UserFault("expanded_size")
    return whole.getvalue()


def _read_loose(roles: list[str], parts: list[_Metered], heads: list[bytes], limits: PackageLimits) -> RawPackage:
    """Loose files: a network, its metadata, the weights beside it."""
    if max(roles.count(_NETWORK), roles.count(_METADATA)) > 1:
        raise UserFault("upload_parts")
    found: dict[str, bytes] = {}
    weights: dict[str, bytes] = {}
    left = limits.model_bytes
    for role, part, head in zip(roles, parts, heads, strict=True):
        if role == _NETWORK and (foreign := kinds.foreign_format(head)):
            raise UserFault("network_format", format=foreign, member=printable(part.name))
        if role == _NETWORK and network_kind(head) is None:
            raise UserFault("torch_file" if kinds.is_pickle(head) else "not_a_model")
        content = part.read_all(head, limits.metadata_bytes if role == _METADATA else left)
        if role == _METADATA:
            found[role] = content
            continue
        left -= len(content)
        if left < 0:
            part.exhaust()  # reports what exceeds the upload's limit as well
            raise UserFault("model_too_large", limit_mb=limits.model_bytes >> 20)
        if role == _NETWORK:
            found[role] = content
        else:
            name = part.name.replace("\\", "/").rsplit("/", 1)[-1]
            if name in weights:
                raise UserFault("upload_parts")
            weights[name] = content
    digests = [hashlib.sha256(found.get(role, b"")).digest() for role in (_NETWORK, _METADATA)]
    digests += [hashlib.sha256(weights[name]).digest() for name in sorted(weights)]
    return _package(
        found.get(_NETWORK),
        found.get(_METADATA),
        limits,
        found=choose.list_names(part.name for part in parts),
        source_sha256=_joint_digest(*digests),
        weights=weights,
    )


def _joint_digest(*digests: bytes) -> str:
    return hashlib.sha256(b"".join(digests)).hexdigest()


def _package(
    model: bytes | None, metadata: bytes | None, limits: PackageLimits, kind: str = "", found: str = "", **rest: Any
) -> RawPackage:
    if kind == SB3 and metadata is None:
        raise UserFault("sb3_metadata_missing")
    if kind != SB3 and model is not None:
        kind = network_kind(model) or ""
        if not kind:
            raise UserFault("not_a_model") if model else UserFault("empty")
        if rest["weights"] and not kinds.FORMATS[kind].weights:
            raise UserFault("upload_parts")
    if metadata is None:
        raise UserFault("metadata_missing" if model is not None else "model_missing", found=found)
    if len(metadata) > limits.metadata_bytes:
        raise _metadata_too_large(limits)
    if model is None:
        raise UserFault("model_missing", found=found)
    return RawPackage(kind, model, metadata, **rest)

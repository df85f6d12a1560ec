"""Reads a racer's own car in this process, like the site but without its sandbox."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from paddock.errors import UserFault
from paddock.network.bound import FactsDocument

from .admission import admit_network
from .kinds import FORMATS
from .limits import DEFAULT_LIMITS
from .metadata import MetadataDocument, parse_metadata
from .read import UploadPart, read_upload


@dataclass(frozen=True)
class OwnCar:
    """A car as it races: its canonical network, its metadata, the facts of its admission
    (:class:`paddock.network.bound.NetworkFacts`), and its identity."""

    onnx: bytes
    metadata: MetadataDocument
    facts: FactsDocument
    sha256: str


def read_car(paths: Sequence[Path], checkpoint: str = "") -> OwnCar:
    """The car in these files, in any upload format but the zip of stable-baselines3. Takes about a second.

    Raises UserFault with the site's code, ``sb3_at_home`` for that zip, and OSError for an unreadable file."""
    with ExitStack() as stack:
        parts = [UploadPart(path.name, stack.enter_context(path.open("rb"))) for path in paths]
        package = read_upload(parts, DEFAULT_LIMITS, checkpoint=checkpoint)
    if code := FORMATS[package.kind].at_home:
        raise UserFault(code)
    metadata = parse_metadata(package.metadata_json, DEFAULT_LIMITS)
    held = [package.model]
    package = replace(package, model=b"")
    canonical = admit_network(package.kind, held, metadata, DEFAULT_LIMITS, package.weights)
    return OwnCar(canonical.onnx, metadata.to_dict(), canonical.facts.to_dict(), canonical.sha256)

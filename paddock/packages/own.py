"""A racer's own car, read in this very process: the site's reading, gate and identity, without its sandbox."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from paddock.errors import UserFault

from .admission import admit_network
from .identity import identity
from .kinds import SB3
from .limits import DEFAULT_LIMITS
from .metadata import parse_metadata
from .read import UploadPart, read_upload


@dataclass(frozen=True)
class OwnCar:
    """A car as it races: its canonical network, its metadata as the platform keeps it, what its admission found out
    (:class:`paddock.network.bound.NetworkFacts`), and who it is."""

    onnx: bytes
    metadata: dict[str, Any]
    facts: dict[str, Any]
    sha256: str


def read_car(paths: Sequence[Path], checkpoint: str = "") -> OwnCar:
    """The car in these files, in any form that may be uploaded but the zip of stable-baselines3, which only a site can
    convert. Takes about a second.

    Raises UserFault with the code that the site would refuse them for, ``sb3_at_home`` for that zip, and OSError for a
    file that cannot be read.
    """
    with ExitStack() as stack:
        parts = [UploadPart(path.name, stack.enter_context(path.open("rb"))) for path in paths]
        package = read_upload(parts, DEFAULT_LIMITS, checkpoint=checkpoint)
    if package.kind == SB3:
        raise UserFault("sb3_at_home")
    metadata = parse_metadata(package.metadata_json, DEFAULT_LIMITS)
    canonical = admit_network(package.kind, package.model, metadata, DEFAULT_LIMITS, package.weights)
    return OwnCar(canonical.onnx, metadata.to_dict(), canonical.facts.to_dict(), identity(canonical.onnx, metadata))

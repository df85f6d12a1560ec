"""The admission of a model: read, convert in the sandbox, gate, identity.

This process unpacks archives and reads the metadata's JSON with bounds; it never parses a stranger's protobuf. It
checks sizes, types and codes of the sandbox's answer and computes the sha-256 itself.
"""

import signal
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from evaluation.sandbox.frames import FrameClosed, FrameError, FrameTimeout, read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import CONVERTER, Limits
from evaluation.sandbox.lock import EXIT_MEMORY
from evaluation.sandbox.process import SandboxedProcess
from evaluation.sandbox.slots import upload_slot
from paddock import exact
from paddock.errors import PlatformFault, UserFault
from paddock.errors.reasons import REASONS
from paddock.network.bound import NetworkFacts
from paddock.network.wire import printable
from paddock.packages.inputs import MOST_FRAMES
from paddock.packages.kinds import FORMATS
from paddock.packages.limits import DEFAULT_LIMITS, PackageLimits
from paddock.packages.metadata import ModelMetadata, identity, parse_metadata
from paddock.packages.read import RawPackage, UploadPart, read_upload

MODULE = "evaluation.garage.conversion_process"
_START_S = 20.0
_HEADER_LIMIT = 16 * 1024
_GREATEST = 1e12  # no count of ours is larger; JSON has no infinity, and Python writes no number of 4301 digits
# canonical bytes, parameters, multiplications, which of several outputs, facts, observations at once (None: as the
# metadata say)
Answer = tuple[bytes, int, int, str, NetworkFacts, int | None]


class UploadReader(NamedTuple):
    """A sandboxed process that reads one kind of network. ``random``: as in ``launch``."""

    module: str
    limits: Limits
    start_s: float = _START_S
    random: bool = False


# By kind (a word of .kinds); for others MODULE, CONVERTER. Training registers what reads stable-baselines3's.
PROCESSES: dict[str, UploadReader] = {}


@dataclass(frozen=True)
class AdmittedPackage:
    """A model that may race."""

    onnx: bytes  # canonical: what every runtime gets
    sha256: str  # the model's identity
    metadata: ModelMetadata
    source_kind: str  # a word of .kinds
    source_sha256: str  # of the upload itself
    parameters: int
    macs: int  # multiplications a step
    facts: NetworkFacts  # of its arithmetic
    # for the summary of the upload
    taken: str = ""  # the network's name in the archive
    reason: str = ""  # why this checkpoint: a word of .choose
    output: str = ""  # which of several outputs was taken
    ignored: tuple[str, ...] = ()  # files of the archive that were not needed, printable


def admit(
    files: Sequence[UploadPart],
    limits: PackageLimits = DEFAULT_LIMITS,
    *,
    racer_pk: int | None = None,
    slots_directory: Path | None = None,
    checkpoint: str = "",
) -> AdmittedPackage:
    """Read an upload and admit its model, or refuse it. ``racer_pk``: see :func:`evaluation.sandbox.slots.upload_slot`.
    ``checkpoint``: of a training's folder: ``best``, ``last``, a number, or nothing for the best known.

    Takes about a second. Raises UserFault (upload, metadata, conversion, gate sections) or PlatformFault
    (``upload_busy``, ``conversion_failed``, ``sb3_needs_torch``, and those of the sandbox).
    """
    with upload_slot(limits.slots, limits.slot_wait_s, slots_directory, waiting=limits.waiting, racer_pk=racer_pk):
        package = read_upload(files, limits, checkpoint=checkpoint)
        metadata = parse_metadata(package.metadata_json, limits)
        contents = [package.model, package.metadata_json, *package.weights.values()]
        package = replace(package, model=b"", weights=dict.fromkeys(package.weights, b""))
        onnx, parameters, macs, output, facts, frames = _ask(package, contents, limits)
    if frames is not None:
        metadata = replace(metadata, frame_stack=frames)
    return AdmittedPackage(
        onnx=onnx,
        sha256=identity(onnx, metadata),
        metadata=metadata,
        source_kind=package.kind,
        source_sha256=package.source_sha256,
        parameters=parameters,
        macs=macs,
        facts=facts,
        taken=printable(package.taken, 255),
        reason=package.reason,
        output=output,
        ignored=tuple(printable(name, 255) for name in package.ignored),
    )


def _ask(package: RawPackage, contents: list[bytes], limits: PackageLimits) -> Answer:
    """Have the sandboxed process admit the network. ``contents``: network, metadata and weights; emptied once sent."""
    reader = PROCESSES.get(package.kind)
    if reader is None:
        if code := FORMATS[package.kind].no_process:
            raise PlatformFault(code)
        reader = UploadReader(MODULE, CONVERTER)
    with launch(
        reader.module, limits=reader.limits, arguments=[package.kind], random=reader.random, memory=exact.KEPT_MEMORY
    ) as process:
        process.widen_pipes()
        try:
            process.wait_for_lock(reader.start_s)
        except FrameError as error:
            fault = PlatformFault("conversion_failed")
            fault.add_note(process.stderr_text())
            raise fault from error
        question = {"kind": package.kind, "limits": asdict(limits), "weights": list(package.weights)}
        try:
            write_message(process.stdin, question, contents, process.deadline)
            contents.clear()
            header, blobs = read_message(
                process.stdout, process.deadline, json_limit=_HEADER_LIMIT, blob_limit=limits.model_bytes
            )
        except FrameTimeout as error:
            raise _too_long(process) from error
        except FrameClosed as error:
            raise _death(process) from error
        except FrameError as error:
            raise UserFault("conversion_crashed") from error
        return _checked(header, blobs, limits)


def _too_long(process: SandboxedProcess) -> UserFault | PlatformFault:
    """Out of wall time: the network's fault if it computed all the while, ours if it hardly got the processor."""
    if process.cpu_seconds() > process.limits.cpu_s / 2:
        return UserFault("conversion_time")
    return PlatformFault("upload_busy")


def _death(process: SandboxedProcess) -> UserFault:
    """The process died of the network: of memory, of processor time, or of a crash."""
    status = process.wait(2.0)
    if status == EXIT_MEMORY:
        fault = UserFault("conversion_memory")
    elif status in (-signal.SIGKILL, -signal.SIGXCPU) and process.cpu_s >= process.limits.cpu_s - 1:
        fault = UserFault("conversion_time")
    else:
        fault = UserFault("conversion_crashed")
    fault.add_note(process.stderr_text())
    return fault


def _checked(header: dict, blobs: list[bytes], limits: PackageLimits) -> Answer:
    if header.get("state") == "refused":
        raise _refusal(header.get("error"))
    parameters: Any = header.get("parameters")
    macs: Any = header.get("macs")
    output: Any = header.get("output", "")
    frames: Any = header.get("frame_stack")
    sane = (
        header.get("state") == "admitted"
        and len(blobs) == 1
        and len(blobs[0]) > 0
        and type(parameters) is int
        and 0 <= parameters <= limits.model_bytes
        and type(macs) is int
        and 0 <= macs <= limits.macs
        and isinstance(output, str)
        and (frames is None or (type(frames) is int and 1 <= frames <= MOST_FRAMES))
    )
    try:
        facts = NetworkFacts.from_dict(header["facts"])
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        sane = False
    if not sane:
        raise UserFault("conversion_crashed")
    return blobs[0], parameters, macs, printable(output, 80), facts, frames


def _refusal(error: object) -> UserFault:
    """The fault that the process reports, if it is one; its parameters are a stranger's text."""
    report = error if isinstance(error, dict) else {}
    code = report.get("code")
    if not isinstance(code, str) or code not in REASONS or REASONS[code].fault != "user":
        return UserFault("conversion_crashed")
    given = report.get("params")
    params: dict[str, str | int | float] = {}
    for name, value in given.items() if isinstance(given, dict) else ():
        if isinstance(value, str):
            params[printable(name, 40)] = printable(value, 200)
        elif type(value) in (int, float) and abs(value) <= _GREATEST:
            params[printable(name, 40)] = value
    return UserFault(code, **params)

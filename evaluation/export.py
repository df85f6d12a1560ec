"""A model for others than Paddock: written by a sandboxed process, because a stranger made its network."""

from __future__ import annotations

import time
from typing import Any

from evaluation.sandbox.frames import FrameError, read_message, write_message
from evaluation.sandbox.launch import launch, widen_pipe
from evaluation.sandbox.limits import CONVERTER
from paddock.errors import PlatformFault, UserFault
from paddock.network.wire import printable
from paddock.packages.limits import PackageLimits

from .slots import default_directory, upload_slot

MODULE = "evaluation.export_process"
_START_S = 20.0
_HEADER_LIMIT = 16 * 1024
_LOCKED = {"state": "locked"}
_USERS = ("export_operator", "export_frame_stack", "network_too_wide")  # what a process may say of a network
# Exports are short, and one that is waited for is served: a page with several models asks for several at once. Whoever
# waits holds a thread of the web server, so not for longer than this.
_WAITING = 4
_WAIT_S = 8.0
_MORE = 16 << 20  # that an archive may be larger than its network: indices in place of steps, and descriptions


def export_in_sandbox(onnx: bytes, metadata: bytes, form: str, limits: PackageLimits, *, who: int) -> bytes:
    """A canonical network as an archive of one of :data:`paddock.packages.kinds.EXPORTS`. ``who``: the racer's number.

    Takes about half a second; where others are being written, up to eight more until its turn. Raises UserFault
    ``export_operator``, ``export_frame_stack``, ``network_too_wide``, and PlatformFault ``upload_busy``,
    ``export_failed`` and those of the sandbox. Leaves no file and no process behind.
    """
    slots = default_directory() / "exports"  # uploads do not wait for downloads
    with (
        upload_slot(limits.slots, min(_WAIT_S, limits.slot_wait_s), slots, waiting=_WAITING, who=who),
        launch(MODULE, limits=CONVERTER) as process,
    ):
        widen_pipe(process.stdin)
        widen_pipe(process.stdout)
        try:
            started = time.monotonic() + _START_S
            header, _ = read_message(process.stdout, started, json_limit=_HEADER_LIMIT, blob_limit=0)
            if header != _LOCKED:
                raise PlatformFault("export_failed")
            question = {"form": form, "limits": limits.to_dict()}
            write_message(process.stdin, question, [onnx, metadata], process.deadline)
            header, blobs = read_message(
                process.stdout, process.deadline, json_limit=_HEADER_LIMIT, blob_limit=len(onnx) + _MORE
            )
        except FrameError as error:
            fault = PlatformFault("export_failed")
            fault.add_note(process.stderr_text())
            raise fault from error
    if header.get("state") == "refused":
        raise _refusal(header.get("error"))
    if header.get("state") != "written" or len(blobs) != 1 or not blobs[0]:
        raise PlatformFault("export_failed")
    return blobs[0]


def _refusal(error: object) -> UserFault | PlatformFault:
    """The fault that the process reports, if it is one; its parameters are a stranger's text."""
    told: dict[str, Any] = error if isinstance(error, dict) else {}
    given = told.get("params")
    if told.get("code") not in _USERS or not isinstance(given, dict):
        return PlatformFault("export_failed")
    params = {name: printable(value, 120) for name, value in given.items() if isinstance(value, str)}
    return UserFault(told["code"], **params)

"""Exports a model in another format, in a sandboxed process because a stranger made its network."""

from collections.abc import Mapping
from dataclasses import asdict

from evaluation.sandbox.frames import FrameError, read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import CONVERTER
from paddock.errors import PlatformFault, UserFault
from paddock.network.wire import printable
from paddock.packages.limits import PackageLimits

from ..sandbox.claims import default_directory
from ..sandbox.slots import upload_slot

MODULE = "evaluation.garage.export_process"
_START_S = 20.0
_HEADER_LIMIT = 16 * 1024
_USERS = ("export_operator", "export_frame_stack", "network_too_wide")  # that a process may report of a network
# Exports are short, and a page with several models requests several at once, so some may wait. A waiting request holds
# a thread of the web server, so not for longer than this.
_WAITING = 4
_WAIT_S = 8.0
_MORE = 16 << 20  # that an archive may be larger than its network: indices in place of steps, and descriptions


def export_in_sandbox(onnx: bytes, metadata: bytes, form: str, limits: PackageLimits, *, racer_pk: int) -> bytes:
    """A canonical network as an archive of one of :data:`paddock.packages.kinds.EXPORTS`. ``racer_pk``: the reader.

    Takes about half a second, and up to eight more in the queue. Raises UserFault ``export_operator``,
    ``export_frame_stack``, ``network_too_wide``, and PlatformFault ``upload_busy``, ``export_failed`` and those of the
    sandbox.
    """
    slots = default_directory() / "exports"  # uploads do not wait for downloads
    with (
        upload_slot(limits.slots, min(_WAIT_S, limits.slot_wait_s), slots, waiting=_WAITING, racer_pk=racer_pk),
        launch(MODULE, limits=CONVERTER) as process,
    ):
        process.widen_pipes()
        try:
            process.wait_for_lock(_START_S)
            question = {"form": form, "limits": asdict(limits)}
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
    """The fault that the process reports; its parameters are a stranger's text."""
    report: Mapping[str, object] = error if isinstance(error, dict) else {}
    code, given = report.get("code"), report.get("params")
    if not isinstance(code, str) or code not in _USERS or not isinstance(given, dict):
        return PlatformFault("export_failed")
    params = {name: printable(value, 120) for name, value in given.items() if isinstance(value, str)}
    return UserFault(code, **params)

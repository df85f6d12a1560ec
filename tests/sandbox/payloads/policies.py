"""Policy processes that misbehave, in the place of :mod:`evaluation.sandbox.policy_process`.

``sys.argv[1]`` says how, ``sys.argv[2]`` in which step (the third unless it is given).
They stand for a runtime that a network took over: they know the protocol and break it on purpose.
"""

import contextlib
import ctypes
import os
import signal
import struct
import sys
import time

from evaluation.sandbox.frames import read_message, write_message

STEP = struct.Struct("<I")
FAST = struct.pack("<I", 0)  # the way it was answered
BREAKS_AT = 3


def main(frames_in, frames_out):
    kind = sys.argv[1]
    breaks_at = int(sys.argv[2]) if len(sys.argv) > 2 else BREAKS_AT
    write_message(frames_out, {"state": "locked"})
    if kind in BEFORE_READY:
        read_message(frames_in)
        BEFORE_READY[kind](frames_in, frames_out)
        sleep()
    read_message(frames_in)
    header, _ = read_message(frames_in)
    write_message(frames_out, {"state": "ready", "version": "0"})
    count = header["outputs"]
    size = STEP.size + sum(_bytes(sensor) for sensor in header["inputs"])
    if kind == "never_reads":
        sleep()
    while True:
        request = b""
        while len(request) < size:
            chunk = os.read(frames_in, size - len(request))
            if not chunk:
                return 0
            request += chunk
        (step,) = STEP.unpack_from(request)
        if step == breaks_at:
            status = AT_A_STEP[kind](frames_in, frames_out, step, count)
            if status is not None:
                return status
        else:
            os.write(frames_out, exact(step, count) if kind == "exact_then_late" else reply(step, count))


def reply(step, count, value=0.0):
    return STEP.pack(step) + FAST + struct.pack(f"<{count}f", *([value] * count))


def exact(step, count):
    """As one that computed in float64."""
    return STEP.pack(step) + struct.pack("<I", 1) + struct.pack(f"<{count}f", *([0.0] * count))


def _bytes(sensor):
    size = {"uint8": 1, "float32": 4}[sensor["dtype"]]
    for length in sensor["shape"]:
        size *= length
    return size


def sleep(*_):
    while True:
        time.sleep(60)


def half_a_reply(_in, out, step, count):
    os.write(out, reply(step, count)[:5])
    sleep()


def half_a_reply_and_death(_in, out, step, count):
    os.write(out, reply(step, count)[:5])
    return 0


def two_replies(_in, out, step, count):
    os.write(out, reply(step, count) * 2)


def another_step(_in, out, _step, count):
    os.write(out, reply(2, count))


def flood_of_replies(_in, out, step, count):
    for _ in range(1000):
        os.write(out, reply(step, count) * 100)


def not_a_number(_in, out, step, count):
    os.write(out, reply(step, count, float("nan")))


def infinity(_in, out, step, count):
    os.write(out, reply(step, count, float("-inf")))


def close_and_run_on(frames_in, out, _step, _count):
    os.close(frames_in)
    os.close(out)
    sleep()


def return_nothing(*_):
    return 0


def return_three(*_):
    return 3


def crash(*_):
    ctypes.string_at(8)


def abort(*_):
    os.abort()


def grow(*_):
    held = []
    while True:
        held.append(bytes(64 * 1024 * 1024))  # not touched: filling it takes seconds


def burn(*_):
    while True:
        pass


def flood_stderr(_in, out, step, count):
    for _ in range(1024):
        with contextlib.suppress(BlockingIOError):
            os.write(2, b"x" * 1024 * 1024)
    os.write(out, reply(step, count))


def ignore_signals(*_):
    for number in range(1, signal.NSIG):
        with contextlib.suppress(OSError, ValueError):
            signal.signal(number, signal.SIG_IGN)
    sleep()


def slow_once(_in, out, step, count):
    time.sleep(0.3)
    os.write(out, reply(step, count))


def unknown_way(_in, out, step, count):
    os.write(out, STEP.pack(step) + struct.pack("<I", 9) + reply(step, count)[8:])


def huge_values(_in, out, step, count):
    os.write(out, reply(step, count, 3.0e38))


AT_A_STEP = {
    function.__name__: function
    for function in (
        half_a_reply,
        half_a_reply_and_death,
        two_replies,
        another_step,
        flood_of_replies,
        not_a_number,
        infinity,
        close_and_run_on,
        return_nothing,
        return_three,
        crash,
        abort,
        grow,
        burn,
        sleep,
        flood_stderr,
        ignore_signals,
        slow_once,
        huge_values,
        unknown_way,
    )
}
AT_A_STEP["exact_then_late"] = sleep
BEFORE_READY = {
    "never_ready": sleep,
    "dies_loading": lambda *_: os._exit(9),
    "junk_for_ready": lambda _in, out: write_message(out, {"state": "champion"}),
    "frame_too_large_for_ready": lambda _in, out: os.write(out, struct.pack("<I", 0xFFFFFFFF)),
    "no_json_for_ready": lambda _in, out: os.write(out, struct.pack("<I", 3) + b"\xff\xfe\xfd"),
    "refuses_with_a_novel": lambda _in, out: write_message(
        out, {"state": "refused", "detail": "<script>" * 200, "version": "9" * 100}
    ),
    "refuses_with_poison": lambda _in, out: write_message(
        out, {"state": "refused", "detail": "\0\ud800\x1b[31m\u202e", "version": "\0\ud800"}
    ),
    "ready_with_poison": lambda _in, out: write_message(out, {"state": "ready", "version": "\0\ud800\n"}),
}

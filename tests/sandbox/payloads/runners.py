"""Runner processes that fail, in the place of :mod:`evaluation.running.runner_process`. ``sys.argv[1]`` names it."""

import os
import struct
import sys
import time

from evaluation.sandbox.frames import read_message, write_message

HEADER = {"inputs": [{"name": "FRONT_FACING_CAMERA", "dtype": "uint8", "shape": [120, 160, 1]}], "outputs": 3}


def hang(_out):
    while True:
        time.sleep(60)


def hang_within_a_message(out):
    os.write(out, struct.pack("<I", 100) + b"half")
    hang(out)


def crash(_out):
    os.abort()


def fall_silent(out):
    os.close(out)
    hang(out)


def speak_nonsense(out):
    write_message(out, {"hello": 1})


def speak_no_json(out):
    os.write(out, struct.pack("<I", 3) + b"\xff\xfe\xfd")


def announce_too_much(out):
    os.write(out, struct.pack("<I", 0xFFFFFFFF))


def unknown_code(out):
    write_message(out, {"error": {"code": "no_such_code", "params": {}}})


def error_of_no_form(out):
    write_message(out, {"error": ["policy_late"]})


def incomplete_result(out):
    write_message(out, {"result": {"laps": []}, "seconds": {}}, [b""])
    hang(out)


def result_without_a_trace(out):
    write_message(out, {"result": {}, "seconds": {}})


def retires_nobody(out):
    write_message(out, {"retired": {"car": 7, "error": {"code": "policy_died", "params": {}}}})
    hang(out)


def grow(_out):
    held = []
    while True:
        held.append(bytearray(64 * 1024 * 1024))


def main(frames_in, frames_out):
    kind = sys.argv[1]
    when, _, name = kind.partition(":")
    os.write(2, b"the runner's last words\n")
    job, _ = read_message(frames_in)
    if when == "start":
        globals()[name](frames_out)
    write_message(frames_out, {"headers": [HEADER] * len(job["metadata"])})
    read_message(frames_in)
    globals()[name](frames_out)

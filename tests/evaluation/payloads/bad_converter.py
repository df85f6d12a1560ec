"""Stands in for the converter and misbehaves once it is locked, as one that a network has taken over might."""

from __future__ import annotations

import os
import sys

from evaluation.sandbox.frames import read_message, write_frame, write_message

LOCKED = {"state": "locked"}


def main(frames_in: int, frames_out: int) -> int:
    deed = sys.argv[1]
    if deed == "never_locks":
        return 5
    write_message(frames_out, LOCKED)
    read_message(frames_in)
    if deed == "aborts":
        os.abort()
    if deed == "returns_early":
        return 0
    if deed == "computes_for_ever":
        while True:
            pass
    if deed == "fills_memory":
        hoard = []
        while True:
            hoard.append(bytes(64 << 20))  # not touched: filling it takes seconds
    if deed == "garbage":
        write_frame(frames_out, b"\x00\xff garbage")
    if deed == "announces_too_much":
        write_message(frames_out, {"state": "admitted", "parameters": 1, "macs": 1, "blobs": [1 << 40]})
    if deed == "forges_a_platform_fault":
        write_message(frames_out, {"state": "refused", "error": {"code": "upload_busy", "params": {}}})
    if deed == "invents_a_code":
        write_message(frames_out, {"state": "refused", "error": {"code": "you_won", "params": {}}})
    if deed == "hides_codes_in_a_sentence":
        params = {"operator": "\x1b[31m<script>" + "x" * 5000, "attribute": ["a", "list"]}
        write_message(frames_out, {"state": "refused", "error": {"code": "onnx_attribute", "params": params}})
    if deed == "counts_beyond_all_numbers":
        error = b'{"code": "onnx_output", "params": {"expected": 1e999, "found": 1%s}}' % (b"0" * 4000)
        write_frame(frames_out, b'{"state": "refused", "error": %s}' % error)
    if deed == "answers_without_a_network":
        write_message(frames_out, {"state": "admitted", "parameters": 1, "macs": 1})
    if deed == "counts_in_words":
        write_message(frames_out, {"state": "admitted", "parameters": "many", "macs": 1}, [b"onnx"])
    if deed == "knows_no_bound":
        facts = {"bound": "small", "shapes": {}}
        write_message(frames_out, {"state": "admitted", "parameters": 1, "macs": 1, "facts": facts}, [b"onnx"])
    if deed in ("stacks_no_frames", "stacks_too_many_frames"):
        facts = {"bound": None, "shapes": {}}
        said = {"state": "admitted", "parameters": 1, "macs": 1, "facts": facts}
        write_message(frames_out, {**said, "frame_stack": 0 if "no" in deed else 9}, [b"onnx"])
    if deed == "counts_less_than_nothing":
        write_message(frames_out, {"state": "admitted", "parameters": -1, "macs": 1}, [b"onnx"])
    return 0

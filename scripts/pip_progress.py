"""Runs pip and prints one line: how many packages it has found, what it downloads, and how long it took.

    python scripts/pip_progress.py install --requirement locks/run.txt

The line goes on every few seconds and names each large file. What pip itself prints is shown where it fails. ``STEP``
and ``STEPS`` of the environment stand before the line.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from time import monotonic

EVERY_S = 5.0
LARGE_MB = 50.0
UNREACHABLE = (
    "The package index cannot be reached: connect to a network, or name a mirror with PIP_INDEX_URL or a folder of "
    "wheels with PIP_FIND_LINKS."
)
_DOWNLOAD = re.compile(r"\s*Downloading (?:\S+/)?([A-Za-z0-9_.]+)-\S+ \(([\d.]+) ([kMG])B\)")
_MB = {"k": 0.001, "M": 1.0, "G": 1000.0}
_FOUND = ("Collecting ", "Requirement already satisfied: ", "Obtaining ")


def main(arguments: list[str]) -> int:
    """Returns pip's exit status."""
    locks = [Path(name) for option, name in pairwise(arguments) if option == "--requirement"]
    total = sum(line[:1].isalnum() for lock in locks for line in lock.read_text().splitlines())
    what = ", ".join(map(str, locks)) or Path(arguments[-1]).name or "Paddock"  # the last one is a wheel or "."
    begun = printed = monotonic()
    step = f"[{os.environ['STEP']}/{os.environ['STEPS']}] " if {"STEP", "STEPS"} <= os.environ.keys() else ""
    print(f"{step}Installing {what}", *([f"({total} packages)"] if total else []), "...", end="", flush=True)
    lines, found, megabytes = [], 0, 0.0
    command = [sys.executable, "-m", "pip", *arguments, "--progress-bar", "off"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    ) as pip:
        assert pip.stdout is not None
        for line in pip.stdout:
            lines.append(line)
            found += line.startswith(_FOUND)
            now = monotonic()
            if download := _DOWNLOAD.match(line):
                size = float(download[2]) * _MB[download[3]]
                megabytes += size
                if size >= LARGE_MB:
                    print(f" downloading {size:.0f} MB of {download[1]} ...", end="", flush=True)
            elif line.startswith("Installing collected packages"):
                print(" unpacking ...", end="", flush=True)
            elif total and line.startswith(_FOUND) and now - printed >= EVERY_S:
                printed = now
                print(f" {found} of {total} ...", end="", flush=True)
    print(f"{f' {megabytes:.0f} MB,' if megabytes >= 1 else ''} {monotonic() - begun:.1f} s")
    if pip.returncode:
        print("".join(lines), end="")
        if any("Failed to establish a new connection" in line for line in lines):
            print(UNREACHABLE)
    return pip.returncode


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)

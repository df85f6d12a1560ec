"""How a benchmark begins and ends as a command: its options, and what it prints."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from typing import Any

Figures = dict[str, Any]


def command(module: str, about: str) -> argparse.ArgumentParser:
    """The parser of ``python -m benchmarks.<module>``, with the option ``--json`` that every one has."""
    parser = argparse.ArgumentParser(f"python -m benchmarks.{module}", description=about)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    return parser


def report(figures: Figures, *, as_json: bool, table: Callable[[Figures], str], missed: Sequence[str] = ()) -> int:
    """Print the figures, and on standard error which promises they do not keep. The exit status: 1 where there are
    such."""
    print(json.dumps(figures, indent=2) if as_json else table(figures))
    for promise in missed:
        print(f"missed: {promise}", file=sys.stderr)
    return 1 if missed else 0

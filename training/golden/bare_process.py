"""``python -m training.golden.bare_process``: drives the runs of stdin's JSON list in this process.

No sandbox, no pipes: this is what runs under an emulator. It wants the pins of :mod:`paddock.exact` in its environment
and ends with 2 without them.
"""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING

from paddock import exact

if TYPE_CHECKING:
    from .runs import GoldenRunDocument


def answer_each(program: str, drive: Callable[["GoldenRunDocument"], object]) -> int:
    """Print what ``drive`` makes of each description of a run on stdin, as JSON and as soon as it is there.

    2 without the pins. ``program``: what is started with ``python -m paddock.exact -m``.
    """
    if not exact.is_pinned():
        print(f"start this with the pins: python -m paddock.exact -m {program}", file=sys.stderr)
        return 2
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # Bullet prints its build date on stdout
    for described in json.load(sys.stdin):
        print(json.dumps(drive(described)), file=answers, flush=True)
    return 0


def _driven(described: "GoldenRunDocument") -> dict[str, object]:
    from .drive import in_this_process  # loads Bullet
    from .runs import GoldenRun

    return asdict(in_this_process(GoldenRun.from_dict(described)))


def main() -> int:
    return answer_each("training.golden.bare_process", _driven)


if __name__ == "__main__":
    sys.exit(main())

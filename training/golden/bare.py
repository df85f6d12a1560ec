"""``python -m training.golden.bare``: drives runs in this one process; a JSON object for each on stdin's JSON list.

No wall, no pipes: this is what runs under an emulator. It wants the pins of :mod:`evaluation.exact` in its environment
and ends with 2 without them.
"""

from __future__ import annotations

import json
import os
import sys

from evaluation import exact


def main() -> int:
    """Drive what stdin lists (:meth:`.runs.GoldenRun.to_dict`), and print what each came to as soon as it did."""
    if not exact.is_pinned():
        print("start this with the pins: python -m evaluation.exact -m training.golden.bare", file=sys.stderr)
        return 2
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # Bullet says when it was built, on stdout
    from .drive import in_this_process
    from .runs import GoldenRun

    for described in json.load(sys.stdin):
        driven = in_this_process(GoldenRun.from_dict(described))
        print(json.dumps(driven.to_dict()), file=answers, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Every reason is known to the site's processes from the start, also those that only a sandboxed process raises."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
# the command of racers at home, which is no process of the site
ELSEWHERE = {"paddock/cli/reasons.py"}
ASK = """
import json, os, sys
os.environ.setdefault("DJANGO_SETTINGS_MODULE", "tests.settings")
import django
django.setup()
from paddock.errors.reasons import REASONS
known = sorted(REASONS)
from importlib import import_module
for module in json.loads(sys.argv[1]):
    import_module(module)
print(json.dumps([known, sorted(REASONS)]))
"""


def test_a_process_of_the_site_knows_every_reason() -> None:
    """What a sandboxed process reports is believed by its code: an unknown one became ``conversion_crashed``."""
    files = [path.relative_to(CHECKOUT) for path in CHECKOUT.glob("[a-z]*/**/reasons.py")]
    modules = [
        ".".join(path.with_suffix("").parts)
        for path in files
        if str(path) not in ELSEWHERE and path.parts[0] != "tests"
    ]
    assert "training.sb3.reasons" in modules
    command = [sys.executable, "-c", ASK, json.dumps(modules)]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=True)
    known, every = json.loads(done.stdout.splitlines()[-1])
    assert not set(every) - set(known)

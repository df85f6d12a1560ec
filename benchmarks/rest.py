"""``python -m benchmarks.rest [--json]``: what a site takes that does nothing, and how long a later start takes.

Starts ``manage.py run`` on a data folder that is ready, with training (where it is installed) and without. Measures the
seconds until it says that it is ready and until every part of ``/health/ready`` is true, and the processor's seconds of
all its processes until then. At rest it adds up the proportional set sizes (PSS) of all processes: a page that n of
them share counts 1/n in each. Seconds depend on the machine. The promise is therefore a ratio: of processor seconds to
those in which one process loads the site's settings and models, measured before each start.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

from .models import CHECKOUT
from .report import command, report
from .site import SiteError, environment, stop

LIMITS_MB = {"with training": 400, "without training": 300}  # what is promised of the site at rest
RATIO = 3.0  # and of the processor seconds of a later start, to those of loading settings and models
READY_S = 300.0
_LOAD = "import django; django.setup()"


def measure(starts: int, rest_s: float) -> dict[str, Any]:
    """Medians of ``starts`` starts with training and without, and what is taken ``rest_s`` after the last one."""
    load = os.getloadavg()[0]
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="paddock-bench-") as folder:
        state = Path(folder) / "state"
        if ready := os.environ.get("BENCH_SITE"):
            shutil.copytree(ready, state, ignore=shutil.ignore_patterns("*.sock"))
        subprocess.run([sys.executable, "manage.py", "setup", "--no-input"], cwd=CHECKOUT, env=environment(state))
        for name in LIMITS_MB:
            is_on = name == "with training"
            if is_on and find_spec("torch") is None:
                continue
            found[name] = _measured(environment(state) | {"PADDOCK_TRAINING": str(is_on)}, starts, rest_s)
    found["machine"] = {"cores": len(os.sched_getaffinity(0)), "load": [load, os.getloadavg()[0]]}
    return found


def _measured(given: dict[str, str], starts: int, rest_s: float) -> dict[str, Any]:
    found: list[dict[str, float]] = []
    for number in range(starts):
        load_s = -_processor_of_children()
        subprocess.run([sys.executable, "-c", _LOAD], cwd=CHECKOUT, env=given, check=True)
        load_s += _processor_of_children()
        with _site(given) as (site, seconds):
            found.append({"load_s": load_s, **seconds, "ratio": seconds["processor_s"] / load_s})
            if number == starts - 1:
                time.sleep(rest_s)
                processes = _family(site.pid)
    return {
        **{name: median(one[name] for one in found) for name in found[0]},
        "processes": len(processes),
        "mb": sum(mb for _, mb in processes),
        "programs": _by_program(processes),
    }


@contextlib.contextmanager
def _site(given: dict[str, str]) -> Iterator[tuple[subprocess.Popen, dict[str, float]]]:
    """A running site, and what its start took."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    log = Path(given["PADDOCK_DATA"]).with_name("rest.log")
    began = time.perf_counter()
    with log.open("wb") as output:
        run = [sys.executable, "manage.py", "run", "--port", str(port)]
        site = subprocess.Popen(
            run, cwd=CHECKOUT, env=given, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
    try:
        seconds: dict[str, float] = {}
        while len(seconds) < 3:
            passed = time.perf_counter() - began
            if site.poll() is not None or passed > READY_S:
                raise SiteError(f"the site is not ready. Its log ends with:\n{log.read_text()[-4000:]}")
            if "ready_s" not in seconds and b"Paddock is ready" in log.read_bytes():
                seconds["ready_s"] = passed
            if "all_parts_s" not in seconds and _all_parts(port):
                seconds["all_parts_s"] = time.perf_counter() - began
                seconds["processor_s"] = sum(_processor_s(pid) for pid in _pids(site.pid))
            time.sleep(0.02)
        yield site, seconds
    finally:
        stop(site)


def _all_parts(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/health/ready", timeout=5) as answer:
            return all(part for part in json.load(answer).values() if isinstance(part, bool))
    except OSError:
        return False


def _processor_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _processor_s(pid: int) -> float:
    """Of a process and of its children that have ended (proc(5): utime, stime, cutime, cstime)."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def _pids(root: int) -> list[int]:
    """Every process from ``root`` down."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            with contextlib.suppress(OSError):
                parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
                children.setdefault(parent, []).append(int(folder.name))
    found = [root]
    for pid in found:  # which grows
        found += children.get(pid, ())
    return found


def _family(root: int) -> list[tuple[str, float]]:
    """Every process from ``root`` down: its command and its proportional set size in MB."""
    found = []
    for pid in _pids(root):
        with contextlib.suppress(OSError):  # it ended meanwhile
            shown = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            rollup = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
            pss_kb = next(int(line.split()[1]) for line in rollup if line.startswith("Pss:"))
            found.append((shown, pss_kb / 1024))
    return found


def _by_program(processes: list[tuple[str, float]]) -> dict[str, float]:
    words = {
        "manage.py run": "supervisor",
        "config.web": "web",
        "config.streams": "streams",
        "valkey": "broker",
        "--queues training": "trainer",
        "--queues videos": "video-worker",
        "--queues messages": "messenger",
        " beat": "beat",
        " worker ": "worker",
    }
    sums: Counter[str] = Counter()
    for shown, mb in processes:
        sums[next((name for word, name in words.items() if word in shown), "sandbox")] += mb  # type: ignore[assignment]
    return dict(sums)


def misses(found: dict[str, Any]) -> list[str]:
    """What is promised and not kept."""
    said = []
    for name, limit in LIMITS_MB.items():
        if name in found:
            if found[name]["mb"] > limit:
                said.append(f"{name}: {found[name]['mb']:.0f} MB at rest")
            if found[name]["ratio"] > RATIO:
                said.append(f"{name}: a later start takes {found[name]['ratio']:.1f} times the loading of the site")
    return said


def table(found: dict[str, Any]) -> str:
    """For people."""
    lines = []
    for name in (name for name in LIMITS_MB if name in found):
        one = found[name]
        lines += [
            f"{name}: {one['mb']:.0f} MB in {one['processes']} processes",
            f"    ready after {one['ready_s']:.1f} s, all parts after {one['all_parts_s']:.1f} s",
            f"    {one['processor_s']:.1f} s of a processor, {one['ratio']:.1f} times a load",
            *(f"    {program:<14}{mb:7.1f} MB" for program, mb in sorted(one["programs"].items())),
        ]
    return "\n".join([*lines, f"load {found['machine']['load'][0]:.1f}, {found['machine']['load'][1]:.1f}"])


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; 1 when a promise is not kept."""
    parser = command("rest", "Memory of a site at rest, and how long a later start takes.")
    parser.add_argument("--starts", type=int, default=3)
    parser.add_argument("--rest", type=float, default=75.0, help="seconds after the last start (default 75)")
    options = parser.parse_args(arguments)
    found = measure(options.starts, options.rest)
    return report(found, as_json=options.json, table=table, missed=misses(found))


if __name__ == "__main__":
    sys.exit(main())

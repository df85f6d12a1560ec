"""Whatever is killed while a run is shown live: the show goes on or is taken up again, spectators see the same runs and
nothing before its time, and the results are those that anybody computes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from tests.config.test_run import environment
from tests.evaluation.processes import is_running, wait_for
from tests.live_site import QUIET, LiveSite
from tests.shared import CHECKOUT

pytestmark = [pytest.mark.slow, pytest.mark.soak, pytest.mark.xdist_group("run")]
CHUNK_MS = 500
LOOK_S = 0.3
# One of them is killed while each run is shown. None: the whole site, which is then started again.
KILLED = {
    "web": "config.web",
    "streams": "config.streams",
    "worker": "--without-mingle (end)",
    "messenger": "messenger@",  # it launches and reveals
    "beat": " beat ",
    "broker": "valkey-server",
    "everything": None,
    "nothing": "",
}


class Spectator(threading.Thread):
    """Somebody who asks again and again, as a page without a stream does, and keeps all that they were told."""

    def __init__(self, address: str) -> None:
        super().__init__(daemon=True)
        self._base, self._over = f"{address}/races/race-night/event", threading.Event()
        self.chunks: dict[tuple[int, int], str] = {}  # (slot, number): what was shown
        self.early: list[str] = []
        self.changed: list[str] = []
        self.refused = 0

    def run(self) -> None:
        while not self._over.is_set():
            try:
                self.look()
            except OSError:  # what was killed does not answer
                self.refused += 1
            sleep(LOOK_S)

    def stop(self) -> None:
        self._over.set()
        self.join(30)

    def look(self) -> None:
        told = self._ask("state.json")
        current = told["current"]
        for slot in told["order"]:
            if slot["state"] != "done" and slot["evaluation"] is not None:
                self.early.append(f"the run of {slot['slot']} while it is {slot['state']}")
        if current is None:
            return
        slot, starts = current["slot"], current["starts_at"]
        after = max((number for of, number in self.chunks if of == slot), default=-1)
        for said in (self._ask(f"poses.json?slot={slot}&after={max(-1, after - 3)}"),):
            for chunk in said["chunks"]:
                if not said["over"] and starts + (chunk["n"] + 1) * CHUNK_MS > said["now"]:
                    self.early.append(f"chunk {chunk['n']} of {slot}")
                self.keep(slot, chunk)

    def keep(self, slot: int, chunk: dict[str, Any]) -> None:
        seen = json.dumps(chunk, sort_keys=True)
        if self.chunks.setdefault((slot, chunk["n"]), seen) != seen:
            self.changed.append(f"chunk {chunk['n']} of {slot}")

    def whole(self, slot: int) -> dict[int, str]:
        """All of a run that was shown."""
        found: dict[int, str] = {}
        after = -1
        while True:
            said = self._ask(f"poses.json?slot={slot}&after={after}")
            for chunk in said["chunks"]:
                after = chunk["n"]
                found[after] = json.dumps(chunk, sort_keys=True)
            if said["over"] or not said["chunks"]:
                return found

    def _ask(self, path: str) -> dict[str, Any]:
        with urllib.request.urlopen(f"{self._base}/{path}", timeout=20) as answer:
            return json.load(answer)


def kill(site: LiveSite, words: str | None) -> LiveSite:
    """SIGKILL; the site, or the one that is started in its place."""
    if words is None:
        family = site.family()
        site.process.kill()
        site.process.wait()
        wait_for(lambda: not any(is_running(pid) for pid in family), 60)
        return LiveSite(site.data, site.port).ready()
    if words:
        os.kill(site.pid_of(words), signal.SIGKILL)
    return site


def until(holds: Callable[[], object], limit_s: float, site: LiveSite) -> None:
    end = monotonic() + limit_s
    while not holds():
        assert monotonic() < end, f"it never came true\n{site.said[-4000:]}"
        sleep(0.2)


def count(site: LiveSite, where: str) -> int:
    return site.rows(f"select count(*) from races_liveslot where {where}")[0][0]


def test_whatever_is_killed_the_show_goes_on(tmp_path: Path, new_data: Callable[..., Path]):
    site = LiveSite(new_data(tmp_path / "data", house_cars=0)).ready()
    try:
        site.make("night", cars=4, choose=0, attempt_s=12, rounds=2, starts_s=5, auto_run=True, gap_s=1)
        spectator = Spectator(site.address)
        spectator.start()
        for number, words in enumerate(KILLED.values()):
            on_track = "state = 'running' and starts_at <= datetime('now', '-3 seconds')"
            until(lambda: count(site, on_track) == 1, 240, site)  # noqa: B023
            assert count(site, "state = 'done'") == number
            site = kill(site, words)
            until(lambda: count(site, "state = 'done'") == number + 1, 240, site)  # noqa: B023
        spectator.stop()
        assert not spectator.early, "nothing before its time"
        assert not spectator.changed, "what was shown is the same whenever it is asked for"

        shown = site.rows(
            "select s.id, e.public_id, e.sealed, e.state from races_liveslot s join evaluation_evaluation e on"
            " e.id = s.evaluation_id order by s.position"
        )
        assert [row[2:] for row in shown] == [(0, "finished")] * len(KILLED)
        submissions = site.rows("select count(*), count(distinct evaluation_id) from races_submission where is_live")
        assert submissions == [(len(KILLED), len(KILLED))], "each run counts once"
        assert site.rows("select count(*) from core_event where kind = 'race.result'")[0][0] == len(KILLED)
        for slot, *_ in shown:
            whole = spectator.whole(slot)
            seen = {number: text for (of, number), text in spectator.chunks.items() if of == slot}
            assert len(seen) >= 10, "somebody saw most of it"
            assert seen.items() <= whole.items()
        for _slot, run, *_ in (shown[2], shown[6]):  # the worker was killed, and everything
            command = [sys.executable, "manage.py", "verify", run]
            told = environment(site.data) | QUIET
            done = subprocess.run(command, cwd=CHECKOUT, env=told, capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, done.stdout + done.stderr
        # one car, one result: each racer's two rounds are the same run
        hashes = site.rows(
            "select count(distinct r.trace_sha256) from races_liveslot s join evaluation_result r on"
            " r.evaluation_id = s.evaluation_id group by s.racer_id"
        )
        assert hashes == [(1,)] * 4
    finally:
        family = site.family()
        site.process.kill()
        site.process.wait()
        wait_for(lambda: not any(is_running(pid) for pid in family), 60)

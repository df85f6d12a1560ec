"""A whole site that is killed while a live run is played, and started again: the run is shown again, and verifies."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
from collections.abc import Callable
from contextlib import closing, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from tests.config.test_run import manage
from tests.evaluation.processes import is_running, wait_for
from tests.live_site import START_S, LiveSite

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("run")]
SLOTS = "select position, state, reason_code, starts_at, ends_at, evaluation_id, interrupted_at from races_liveslot"
RUN = (
    "select e.public_id, e.spec, l.start_m, l.seed from evaluation_evaluation e"
    " join races_liveslot s on s.evaluation_id = e.id join races_liveevent l on l.id = s.event_id"
)
PLAYED_S = 2.0
AWAY = timedelta(seconds=12)


def slots(site: LiveSite) -> list[tuple]:
    return sorted(site.rows(SLOTS))


def played_s(site: LiveSite) -> float:
    """For how long the first run has been on track; negative before."""
    state, starts_at = slots(site)[0][1], slots(site)[0][3]
    if state != "running" or starts_at is None:
        return -1.0
    return (datetime.now(UTC) - datetime.fromisoformat(starts_at).replace(tzinfo=UTC)).total_seconds()


def ago(data: Path, time: timedelta) -> None:
    """As if this time had passed: what the clock of the event reads lies further back."""
    moments = {"races_liveslot": ("starts_at", "ends_at"), "races_liveevent": ("clock_at",)}
    with closing(sqlite3.connect(data / "paddock.sqlite3")) as database, database:
        for table, columns in moments.items():
            for column in columns:
                for key, moment in database.execute(f"select id, {column} from {table} where {column} is not null"):
                    earlier = datetime.fromisoformat(moment) - time
                    database.execute(f"update {table} set {column} = ? where id = ?", (earlier.isoformat(" "), key))


def test_a_run_that_a_restart_cut_off_is_shown_again(tmp_path: Path, new_data: Callable[..., Path]) -> None:
    data = new_data(tmp_path / "data", house_cars=0)
    with LiveSite(data) as site:
        site.ready()
        site.make("night", cars=1, choose=0, attempt_s=20, starts_s=1, auto_run=True, gap_s=0)
        wait_for(lambda: slots(site) and played_s(site) > PLAYED_S, START_S, site.log)
        before = slots(site)[0]
        family = site.family()
        for pid in family:  # the power goes
            with suppress(ProcessLookupError):  # its parent, killed before it, may have had it end
                os.kill(pid, signal.SIGKILL)
        site.process.wait()
        wait_for(lambda: not any(is_running(pid) for pid in family), 20, site.log)
    ago(data, AWAY)  # nobody can see the run meanwhile
    with LiveSite(data, site.port) as again:
        again.ready()
        wait_for(lambda: slots(again)[0][6] is not None, START_S, again.log)
        shown = slots(again)[0]
        assert (shown[1], shown[2], shown[5]) == ("running", "live_interrupted", before[5]), "the same run"
        assert shown[3] > before[3], "from a new start"
        assert again.rows("select count(*) from races_submission where is_live")[0][0] == 0, "it is no result yet"
        wait_for(lambda: slots(again)[0][1] == "done", START_S, again.log)
        assert slots(again)[0][5] == before[5]
        assert again.rows("select count(*) from races_submission where is_live")[0][0] == 1
        ((run, spec, start_m, seed),) = again.rows(RUN)
        rules = json.loads(spec)["rules"]
        assert (rules["start_m"], rules["seed"]) == (start_m, seed), "what the event announced"
        assert start_m > 0
        verified = manage(data, "verify", run)
        assert verified.returncode == 0, verified.stdout + verified.stderr
        again.stop(signal.SIGINT)

"""The presets leave honest work at least twice the room it needs."""

from __future__ import annotations

from pathlib import Path

import pytest

from evaluation.running import pipeline
from evaluation.running import process_pool as pool
from evaluation.sandbox.limits import POLICY, PROBE, RUNNER
from evaluation.sandbox.lock import LockSpec
from evaluation.sandbox.policy import PolicyProcess
from evaluation.sandbox.policy_client import TOTAL_S
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import MAX_CARS, RaceRules

from .networks import HEADER, METADATA, console_sized_network, small_network

pytestmark = pytest.mark.usefixtures("nothing_left")


def peak_address_space_mb(process):
    with open(f"/proc/{process.inner_pid}/status") as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith("VmPeak:")) / 1024


def test_a_console_network_needs_under_half_of_a_policys_memory(level):
    with PolicyProcess(level=level) as policy:
        policy.load(console_sized_network(), HEADER)
        assert peak_address_space_mb(policy.process) < POLICY.address_space_mb / 2


def test_a_large_network_uses_huge_pages_where_granted(level):
    granted = Path("/sys/kernel/mm/transparent_hugepage/enabled")
    if not granted.is_file() or "[never]" in granted.read_text():
        pytest.skip("this host has no large pages")
    with PolicyProcess(level=level) as policy:
        policy.load(console_sized_network(), HEADER)
        try:
            lines = Path(f"/proc/{policy.process.inner_pid}/smaps_rollup").read_text().splitlines()
        except PermissionError:
            pytest.skip("only root sees where the memory of a locked process lies")
        on_large_pages_mb = next(int(line.split()[1]) for line in lines if line.startswith("AnonHugePages:")) / 1024
        assert on_large_pages_mb > 10


RIVALS = (pipeline.RivalModel(small_network(seed=1), METADATA),) * (MAX_CARS - 1)


@pytest.mark.parametrize(
    ("rules", "rivals"),
    [
        (RaceRules(max_simulated_ms=60_000), ()),
        (RaceRules(race_type="head_to_head", max_simulated_ms=20_000), RIVALS),
    ],
    ids=["alone", "four cars"],
)
def test_the_largest_track_needs_under_half_of_a_runners_memory(monkeypatch, rules, rivals):
    largest = max(CATALOGUE, key=lambda track: track.length_m)
    started, peaks = [], []
    launch = pool.launch

    def watched(*args, **options):
        started.append(launch(*args, **options))
        return started[-1]

    monkeypatch.setattr(pool, "launch", watched)
    job = pipeline.RaceJob(largest.geometry(), rules, small_network(), METADATA, rivals)
    pipeline.evaluate(job, on_progress=lambda _: peaks.append(peak_address_space_mb(started[0])))
    assert peaks
    assert max(peaks) < RUNNER.address_space_mb / 2


def test_the_cpu_limit_exceeds_the_referees_time_budget():
    assert POLICY.cpu_s > 2 * TOTAL_S
    assert RUNNER.cpu_s >= pipeline.WALL_LIMIT_S * MAX_CARS


@pytest.mark.parametrize("limits", [POLICY, RUNNER, PROBE])
def test_limits_reach_another_process_unchanged(limits):
    assert LockSpec.from_env(LockSpec(limits, None, b"").to_env()).limits == limits

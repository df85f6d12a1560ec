"""Processes that are kept ready for the next evaluation."""

import time
from dataclasses import replace

import pytest

from evaluation.running.pipeline import RaceJob, RivalModel, evaluate
from evaluation.running.process_pool import VENUES_KEPT, ProcessPool, SparePool
from evaluation.sandbox.frames import FrameClosed
from paddock.errors import PlatformFault
from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.rules.race import HEAD_TO_HEAD, RaceRules
from tests.sandbox.networks import METADATA, small_network

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def job():
    return RaceJob(by_slug("oval").geometry(), RaceRules(max_simulated_ms=3_000), small_network(), METADATA)


@pytest.fixture
def spare():
    spare = SparePool()
    yield spare
    spare.close()


def gone(pool: ProcessPool) -> bool:
    return not pool.alive


def rehearsed(pool: ProcessPool) -> ProcessPool:
    """The pool when its runner has nothing more to do than to wait for a job, which has been so for a moment."""
    until = time.monotonic() + 60.0
    idle = 0
    while idle < 5:
        assert time.monotonic() < until
        time.sleep(0.1)
        idle = 0 if pool.runner.cpu_seconds() < 0.1 or pool.runner.wants_processor() else idle + 1
    return pool


def elsewhere(job: RaceJob) -> RaceJob:
    return replace(job, track=by_slug("kuei-raceway").geometry())


def test_a_ready_crew_drives_the_same_race_once(job, spare):
    spare.prepare()
    pool = spare.take(job.venue)
    assert pool is not None and pool.alive
    assert evaluate(job, pool=pool).trace_sha256 == evaluate(job).trace_sha256
    assert gone(pool)
    assert spare.take(job.venue) is None


@pytest.mark.parametrize(
    "changes",
    [{}, {"look": "bold"}, {"rules": RaceRules(max_simulated_ms=3_000, direction="cw")}],
    ids=["track", "look", "direction"],
)
def test_a_crew_rehearsed_on_the_track_drives_the_same_race(job, changes):
    here = replace(job, **changes)
    pool = rehearsed(ProcessPool(venues=[elsewhere(job).venue, here.venue]))
    assert pool.described(here.venue) == {"prepared": 1}
    assert evaluate(here, pool=pool).trace_sha256 == evaluate(here).trace_sha256


def test_a_job_before_the_rehearsal_drives_the_same_race(job):
    pool = ProcessPool(venues=[elsewhere(job).venue, job.venue])
    assert evaluate(job, pool=pool).trace_sha256 == evaluate(job).trace_sha256


@pytest.mark.parametrize("changes", [{"look": "bold"}, {"rules": RaceRules(max_simulated_ms=3_000, direction="cw")}])
def test_a_crew_rehearsed_elsewhere_drives_the_same_race(job, changes):
    here = replace(job, **changes)
    pool = rehearsed(ProcessPool(venues=[job.venue]))  # the track alone does not make it the same place
    assert "venue" in pool.described(here.venue)
    assert evaluate(here, pool=pool).trace_sha256 == evaluate(here).trace_sha256


def test_a_rehearsed_crew_drives_a_race_of_more_cars(job):
    rivals = (RivalModel(small_network(seed=1), METADATA),)
    pool = rehearsed(ProcessPool(venues=[job.venue]))
    together = replace(job, rivals=rivals, rules=replace(job.rules, race_type=HEAD_TO_HEAD))
    assert evaluate(together, pool=pool).trace_sha256 == evaluate(together).trace_sha256


def test_all_tracks_reach_a_runner_that_is_still_starting(job):
    venues = [replace(job, track=track.geometry()).venue for track in CATALOGUE[:VENUES_KEPT]]
    with ProcessPool(venues=venues) as pool:
        assert evaluate(job, pool=pool).end_reason == "time_up"


def test_a_runner_lost_before_its_venues_is_our_fault(job, spare, monkeypatch):
    def closed(*_args, **_options):
        raise FrameClosed("nobody reads")

    monkeypatch.setattr("evaluation.running.process_pool.write_message", closed)
    with pytest.raises(PlatformFault) as caught:
        ProcessPool(venues=[job.venue])
    assert caught.value.code == "sandbox_failed" and "nobody reads" in caught.value.params["detail"]
    spare.take(job.venue)
    spare.prepare()
    assert spare.take(job.venue) is None


def test_a_spare_crew_rehearses_on_the_latest_tracks(job, spare):
    jobs = [replace(job, track=track.geometry()) for track in CATALOGUE[: VENUES_KEPT + 1]]
    for each in (*jobs, jobs[-2]):
        assert spare.take(each.venue) is None
    spare.prepare()
    pool = spare.take(job.venue)
    assert pool.described(jobs[-2].venue) == {"prepared": 0}
    assert pool.described(jobs[-1].venue) == {"prepared": 1}
    assert [each for each in jobs if "venue" in pool.described(each.venue)] == jobs[:-VENUES_KEPT]
    pool.close()


def test_only_one_spare_crew_waits(spare):
    spare.prepare()
    waiting = spare._pool
    spare.prepare()
    assert spare._pool is waiting


def test_a_spare_crew_that_nobody_needs_ends(job):
    spare = SparePool(kept_s=0.3)
    spare.prepare()
    pool = spare._pool
    until = time.monotonic() + 20.0
    while pool.alive:
        assert time.monotonic() < until
        time.sleep(0.05)
    assert spare.take(job.venue) is None


def test_a_crew_at_work_is_not_ended_as_a_spare_one(job):
    spare = SparePool(kept_s=0.3)
    spare.prepare()
    with spare.take(job.venue) as pool:
        time.sleep(0.6)
        assert pool.alive


@pytest.mark.parametrize("which", ["policy", "runner"])
def test_a_crew_that_died_waiting_is_not_handed_out(job, spare, which):
    spare.prepare()
    pool = spare._pool
    process = pool.runner if which == "runner" else pool.policies[0].process
    process.kill()
    assert spare.take(job.venue) is None
    assert gone(pool)
    spare.prepare()
    with spare.take(job.venue) as another:
        assert another.alive


def test_a_closed_spare_leaves_no_process(spare):
    spare.prepare()
    pool = spare._pool
    spare.close()
    assert gone(pool)
    spare.close()


def test_a_crew_that_cannot_start_is_reported_by_the_next_run(job, spare, monkeypatch):
    def fail(*_args, **_options):
        raise PlatformFault("sandbox_failed", detail="no more processes")

    monkeypatch.setattr("evaluation.running.process_pool.launch", fail)
    spare.prepare()
    assert spare.take(job.venue) is None


def test_a_ready_crews_clock_starts_with_its_job(job, spare):
    spare.prepare()
    pool = spare.take(job.venue)
    pool.runner.deadline = 0.0  # it has waited for longer than any race may take
    assert evaluate(job, pool=pool, wall_limit_s=60.0).end_reason == "time_up"

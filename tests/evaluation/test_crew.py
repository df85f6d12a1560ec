"""Processes that are kept ready for the next evaluation."""

import time
from dataclasses import replace

import pytest

from evaluation.crew import VENUES_KEPT, Crew, Spare
from evaluation.pipeline import RaceJob, RivalModel, evaluate
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
    spare = Spare()
    yield spare
    spare.close()


def gone(crew: Crew) -> bool:
    return not crew.alive


def rehearsed(crew: Crew) -> Crew:
    """The crew when its runner has nothing more to do than to wait for a job, which has been so for a moment."""
    until = time.monotonic() + 60.0
    idle = 0
    while idle < 5:
        assert time.monotonic() < until
        time.sleep(0.1)
        idle = 0 if crew.runner.cpu_seconds() < 0.1 or crew.runner.wants_processor() else idle + 1
    return crew


def elsewhere(job: RaceJob) -> RaceJob:
    return replace(job, track=by_slug("kuei-raceway").geometry())


def test_a_ready_crew_drives_the_same_race_once(job, spare):
    spare.prepare()
    crew = spare.take(job.venue)
    assert crew is not None and crew.alive
    assert evaluate(job, crew=crew).trace_sha256 == evaluate(job).trace_sha256
    assert gone(crew)
    assert spare.take(job.venue) is None


@pytest.mark.parametrize(
    "changes",
    [{}, {"look": "bold"}, {"rules": RaceRules(max_simulated_ms=3_000, direction="cw")}],
    ids=["track", "look", "direction"],
)
def test_a_crew_rehearsed_on_the_track_drives_the_same_race(job, changes):
    here = replace(job, **changes)
    crew = rehearsed(Crew(venues=[elsewhere(job).venue, here.venue]))
    assert crew.described(here.venue) == {"prepared": 1}
    assert evaluate(here, crew=crew).trace_sha256 == evaluate(here).trace_sha256


def test_a_job_before_the_rehearsal_drives_the_same_race(job):
    crew = Crew(venues=[elsewhere(job).venue, job.venue])
    assert evaluate(job, crew=crew).trace_sha256 == evaluate(job).trace_sha256


@pytest.mark.parametrize("changes", [{"look": "bold"}, {"rules": RaceRules(max_simulated_ms=3_000, direction="cw")}])
def test_a_crew_rehearsed_elsewhere_drives_the_same_race(job, changes):
    here = replace(job, **changes)
    crew = rehearsed(Crew(venues=[job.venue]))  # the track alone does not make it the same place
    assert "venue" in crew.described(here.venue)
    assert evaluate(here, crew=crew).trace_sha256 == evaluate(here).trace_sha256


def test_a_rehearsed_crew_drives_a_race_of_more_cars(job):
    rivals = (RivalModel(small_network(seed=1), METADATA),)
    crew = rehearsed(Crew(venues=[job.venue]))
    together = replace(job, rivals=rivals, rules=replace(job.rules, race_type=HEAD_TO_HEAD))
    assert evaluate(together, crew=crew).trace_sha256 == evaluate(together).trace_sha256


def test_all_tracks_reach_a_runner_that_is_still_starting(job):
    venues = [replace(job, track=track.geometry()).venue for track in CATALOGUE[:VENUES_KEPT]]
    with Crew(venues=venues) as crew:
        assert evaluate(job, crew=crew).end_reason == "time_up"


def test_a_runner_lost_before_its_venues_is_our_fault(job, spare, monkeypatch):
    def closed(*_args, **_options):
        raise FrameClosed("nobody reads")

    monkeypatch.setattr("evaluation.crew.write_message", closed)
    with pytest.raises(PlatformFault) as caught:
        Crew(venues=[job.venue])
    assert caught.value.code == "sandbox_failed" and "nobody reads" in caught.value.params["detail"]
    spare.take(job.venue)
    spare.prepare()
    assert spare.take(job.venue) is None


def test_a_spare_crew_rehearses_on_the_latest_tracks(job, spare):
    jobs = [replace(job, track=track.geometry()) for track in CATALOGUE[: VENUES_KEPT + 1]]
    for each in (*jobs, jobs[-2]):
        assert spare.take(each.venue) is None
    spare.prepare()
    crew = spare.take(job.venue)
    assert crew.described(jobs[-2].venue) == {"prepared": 0}
    assert crew.described(jobs[-1].venue) == {"prepared": 1}
    assert [each for each in jobs if "venue" in crew.described(each.venue)] == jobs[:-VENUES_KEPT]
    crew.close()


def test_only_one_spare_crew_waits(spare):
    spare.prepare()
    waiting = spare._crew
    spare.prepare()
    assert spare._crew is waiting


@pytest.mark.parametrize("which", ["policy", "runner"])
def test_a_crew_that_died_waiting_is_not_handed_out(job, spare, which):
    spare.prepare()
    crew = spare._crew
    process = crew.runner if which == "runner" else crew.policies[0].process
    process.kill()
    assert spare.take(job.venue) is None
    assert gone(crew)
    spare.prepare()
    with spare.take(job.venue) as another:
        assert another.alive


def test_a_closed_spare_leaves_no_process(spare):
    spare.prepare()
    crew = spare._crew
    spare.close()
    assert gone(crew)
    spare.close()


def test_a_crew_that_cannot_start_is_reported_by_the_next_run(job, spare, monkeypatch):
    def fail(*_args, **_options):
        raise PlatformFault("sandbox_failed", detail="no more processes")

    monkeypatch.setattr("evaluation.crew.launch", fail)
    spare.prepare()
    assert spare.take(job.venue) is None


def test_a_ready_crews_clock_starts_with_its_job(job, spare):
    spare.prepare()
    crew = spare.take(job.venue)
    crew.runner.deadline = 0.0  # it has waited for longer than any race may take
    assert evaluate(job, crew=crew, wall_limit_s=60.0).end_reason == "time_up"

"""Processes that are kept ready for the next evaluation."""

import pytest

from evaluation.crew import Crew, Spare
from evaluation.pipeline import RaceJob, evaluate
from evaluation.simulator.rules import RaceRules
from faults import PlatformFault
from tests.sandbox.networks import METADATA, small_network
from tracks.catalogue import by_slug


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


def test_a_ready_crew_drives_the_same_race_and_is_used_up(job, spare):
    spare.prepare()
    crew = spare.take()
    assert crew is not None and crew.alive
    assert evaluate(job, crew=crew).trace_sha256 == evaluate(job).trace_sha256
    assert gone(crew)
    assert spare.take() is None


def test_only_one_crew_waits(spare):
    spare.prepare()
    waiting = spare._crew
    spare.prepare()
    assert spare._crew is waiting


@pytest.mark.parametrize("which", ["policy", "runner"])
def test_a_crew_that_died_while_it_waited_is_not_handed_out(spare, which):
    spare.prepare()
    crew = spare._crew
    process = crew.runner if which == "runner" else crew.policies[0].process
    process.kill()
    assert spare.take() is None
    assert gone(crew)
    spare.prepare()
    assert spare.take().alive


def test_a_spare_that_is_closed_leaves_no_process(spare):
    spare.prepare()
    crew = spare._crew
    spare.close()
    assert gone(crew)
    spare.close()


def test_a_crew_that_cannot_be_started_is_left_to_the_next_evaluation_to_report(spare, monkeypatch):
    def fail(*_args, **_options):
        raise PlatformFault("sandbox_failed", detail="no more processes")

    monkeypatch.setattr("evaluation.crew.launch", fail)
    spare.prepare()
    assert spare.take() is None


def test_the_wall_time_of_a_ready_crew_begins_with_its_job(job, spare):
    spare.prepare()
    crew = spare.take()
    crew.runner.deadline = 0.0  # it has waited for longer than any race may take
    assert evaluate(job, crew=crew, wall_limit_s=60.0).end_reason == "time_up"

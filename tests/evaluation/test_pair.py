"""Processes that are kept ready for the next evaluation."""

import pytest

from evaluation.pair import Pair, Spare
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


def gone(pair: Pair) -> bool:
    return not pair.alive


def test_a_ready_pair_drives_the_same_race_and_is_used_up(job, spare):
    spare.prepare()
    pair = spare.take()
    assert pair is not None and pair.alive
    assert evaluate(job, pair=pair).trace_sha256 == evaluate(job).trace_sha256
    assert gone(pair)
    assert spare.take() is None


def test_only_one_pair_waits(spare):
    spare.prepare()
    waiting = spare._pair
    spare.prepare()
    assert spare._pair is waiting


@pytest.mark.parametrize("which", ["policy", "runner"])
def test_a_pair_that_died_while_it_waited_is_not_handed_out(spare, which):
    spare.prepare()
    pair = spare._pair
    process = pair.runner if which == "runner" else pair.policy.process
    process.kill()
    assert spare.take() is None
    assert gone(pair)
    spare.prepare()
    assert spare.take().alive


def test_a_spare_that_is_closed_leaves_no_process(spare):
    spare.prepare()
    pair = spare._pair
    spare.close()
    assert gone(pair)
    spare.close()


def test_a_pair_that_cannot_be_started_is_left_to_the_next_evaluation_to_report(spare, monkeypatch):
    def fail(*_args, **_options):
        raise PlatformFault("sandbox_failed", detail="no more processes")

    monkeypatch.setattr("evaluation.pair.launch", fail)
    spare.prepare()
    assert spare.take() is None


def test_the_wall_time_of_a_ready_pair_begins_with_its_job(job, spare):
    spare.prepare()
    pair = spare.take()
    pair.runner.deadline = 0.0  # it has waited for longer than any race may take
    assert evaluate(job, pair=pair, wall_limit_s=60.0).end_reason == "time_up"

"""Many workers, crashing and coming late at random: nothing is lost, nothing counts twice."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from django.core.files.storage import default_storage
from django.db import connection
from django.utils import timezone

from evaluation.models import Evaluation, Result, State
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.results import read_layout, read_trace
from paddock.rules.race import RaceRules
from tests.evaluation.processes import environment, kill_session, session_of
from tests.evaluation.stubs import trace_csv
from tests.rows import model_row
from tests.shared import CHECKOUT

ROWS, WORKERS = 300, 4


@pytest.mark.soak
@pytest.mark.django_db(transaction=True)
@pytest.mark.xdist_group("workers")
def test_every_evaluation_ends_exactly_once_whatever_crashes(alice, bob, charlie, oval, wakes, tmp_path):
    racers = [(racer, model_row(racer, onnx=racer.alias.encode())) for racer in (alice, bob, charlie)]
    for seed in range(ROWS):
        racer, model = racers[seed % 3]
        rivals = [racers[(seed + step) % 3][1] for step in range(1, seed % 4)]
        rules = RaceRules(seed=seed, race_type="head_to_head")
        queue_evaluation(owner=racer, model=model, rivals=rivals, track=oval, rules=rules, now=timezone.now())
    log = tmp_path / "storm.log"
    exit_codes = weather(log)
    said = log.read_text()

    states = dict(Evaluation.objects.values_list("spec__rules__seed", "state"))
    assert states == {seed: State.FAILED if seed % 100 < 3 else State.FINISHED for seed in range(ROWS)}
    assert set(Evaluation.objects.values_list("priority", flat=True)) == {1}  # each end took effect once
    results = Result.objects.select_related("evaluation")
    assert results.count() == sum(state == State.FINISHED for state in states.values())
    kept = set()
    for result in results:
        seed = result.evaluation.spec["rules"]["seed"]
        rivals = list(result.rivals.all())
        cars = [result, *rivals]
        assert [rival.number for rival in rivals] == [*range(1, max(1, seed % 4))]
        assert [read_trace(car) for car in cars] == [trace_csv(salt=seed + number) for number in range(len(cars))]
        assert read_layout(result)["bots"] == [[[seed, 0, 0]]]
        kept |= {file.name.removeprefix("traces/") for file in (result.bots, *(car.trace for car in cars))}
    mine = {evaluation.public_id for evaluation in Evaluation.objects.all()}
    files = [name for name in default_storage.listdir("traces")[1] if name.partition("-")[0] in mine]
    assert set(files) == kept  # what crashes left behind was swept away
    # the weather was bad enough
    crashes = exit_codes.count(-9)
    assert crashes == said.count("crash ") >= 5
    assert said.count("late refused") >= 1
    assert {code for code in exit_codes if code != -9} == {0}
    assert "locked" not in said and "Traceback" not in said.replace("storage_failed. Traceback", "")


def weather(log) -> list[int]:
    """Keep workers running until the queue is empty; the exit status of each."""
    command = [sys.executable, "-m", "tests.evaluation.storm_worker", str(WORKERS)]
    env = environment("redis://127.0.0.1:1/0")
    with log.open("ab") as output:
        storm = subprocess.Popen(
            command, cwd=CHECKOUT, env=env, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
    try:
        assert storm.wait() == 0, log.read_text()[-4000:]
        assert not session_of(storm.pid)
    finally:
        kill_session(storm.pid)
        storm.wait()
    connection.close()
    return [int(status) for status in re.findall(r"^exit (-?\d+)$", log.read_text(), re.MULTILINE)]

"""Real workers, killed at every point of a run: it finishes exactly once, and nothing is left."""

from __future__ import annotations

import os
import signal
from contextlib import ExitStack
from datetime import timedelta
from io import BytesIO
from pathlib import Path

import pytest
from django.core.files.storage import default_storage
from django.utils import timezone
from redis import Redis

from config.celery import app
from evaluation import tasks
from evaluation.garage.services import upload_model
from evaluation.models import Evaluation, Result, State, WorkerNode
from evaluation.running.queue.services import queue_evaluation, stop_evaluation
from league.house_cars.services import house_cars
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules
from tests import servers
from tests.evaluation.held_points import POINTS
from tests.evaluation.processes import (
    celery_worker,
    environment,
    family_of,
    is_running,
    parent_of,
    session_of,
    suspended,
    threads_of,
    wait_for,
)
from tests.rows import model_row

pytestmark = [
    pytest.mark.slow,
    pytest.mark.django_db(transaction=True),
    pytest.mark.xdist_group("workers"),
]
HELD = "tests.evaluation.held_worker"
# Before the result is written, and between its files and its row; all the others in `make soak`
killed_at = pytest.mark.parametrize(
    "points", [("running", "stored"), pytest.param(POINTS, marks=pytest.mark.soak)], ids=["two points", "all points"]
)


@pytest.fixture(scope="module")
def broker_url(request):
    """A broker of our own: the bundled Valkey unless a test asks for Redis."""
    start = getattr(servers, getattr(request, "param", "valkey"))
    with servers.short_folder() as folder, start(folder) as url:
        before = app.conf.broker_url
        app.conf.broker_url = url
        yield url
        app.conf.broker_url = before


@pytest.fixture
def control(tmp_path):
    return Control(tmp_path)


class Control:
    """The remote control of held workers (tests/evaluation/held_worker.py)."""

    def __init__(self, folder):
        self.folder = folder
        self.log = folder / "worker.log"

    def hold_at(self, point):
        (self.folder / "at").write_text(point)

    def held(self):
        """The process that stopped at the point."""
        wait_for((self.folder / "held").exists, 30, self.log)
        pid = int((self.folder / "held").read_text())
        (self.folder / "held").unlink()
        return pid

    def worker(self, broker_url, name="w", **more):
        env = environment(broker_url, HOLD_DIR=str(self.folder), **more)
        return celery_worker(HELD, env, self.log, self.folder / "ready", name)


@pytest.fixture
def submit(alice, oval, broker_url):
    model = model_row(alice)

    def queue(seed=0):
        return queue_evaluation(owner=alice, model=model, track=oval, rules=RaceRules(seed=seed), now=timezone.now())

    return queue


@pytest.fixture
def submit_duel(alice, bob, oval, broker_url):
    models = [model_row(racer, onnx=racer.alias.encode()) for racer in (alice, bob)]
    rules = RaceRules(race_type="head_to_head")

    def queue():
        return queue_evaluation(
            owner=alice, model=models[0], rivals=models[1:], track=oval, rules=rules, now=timezone.now()
        )

    return queue


def lose_patience():
    """Let the leases of dead workers run out now instead of in half a minute."""
    Evaluation.objects.filter(state=State.RUNNING).update(leased_until=timezone.now() - timedelta(seconds=1))


def sweep_now():
    with app.connection_for_write() as connection:  # not from the pool, which knows another test's broker
        tasks.sweep.apply_async(connection=connection)


def finished(evaluation):
    return Evaluation.objects.get(pk=evaluation.pk).state == State.FINISHED


def traces_of(evaluation):
    return [name for name in default_storage.listdir("traces")[1] if name.startswith(evaluation.public_id)]


@killed_at
def test_a_killed_pool_process_costs_one_attempt_and_no_result(submit, control, broker_url, points):
    with control.worker(broker_url):
        for point in points:
            the_pool_process_is_killed_at(point, submit, control)


@pytest.mark.redis
@pytest.mark.parametrize("broker_url", ["redis"], indirect=True)
def test_a_killed_pool_process_is_replaced_with_redis_too(submit, control, broker_url):
    with control.worker(broker_url):
        the_pool_process_is_killed_at("running", submit, control)


def finished_after_a_kill_at(point, submit, control):
    """An evaluation whose process of the pool was killed at that point, and which another one has finished."""
    control.hold_at(point)
    evaluation = submit()
    os.kill(control.held(), signal.SIGKILL)
    if point != "committed":
        lose_patience()
    sweep_now()
    wait_for(lambda: finished(evaluation), 30, control.log)
    return evaluation


def the_pool_process_is_killed_at(point, submit, control):
    evaluation = finished_after_a_kill_at(point, submit, control)
    following = submit(seed=1)
    wait_for(lambda: finished(following), 30, control.log)
    evaluation.refresh_from_db()
    assert evaluation.attempt == (1 if point == "committed" else 2), point
    assert Result.objects.filter(evaluation=evaluation).count() == 1, point
    assert traces_of(evaluation) == [os.path.basename(evaluation.result.trace.name)], point


@killed_at
def test_a_killed_worker_leaves_no_process_and_the_next_finishes(submit, control, broker_url, points):
    with ExitStack() as workers:
        worker = workers.enter_context(control.worker(broker_url, "first"))
        for point in points:
            control.hold_at(point)
            evaluation = submit()
            child = control.held()
            os.kill(worker.pid, signal.SIGKILL)
            wait_for(lambda pids=(worker.pid, child): not session_of(pids[0]) and not is_running(pids[1]))
            lose_patience()
            worker = workers.enter_context(control.worker(broker_url, f"after-{point}"))  # it sweeps when it starts
            wait_for(lambda evaluation=evaluation: finished(evaluation), 30, control.log)
            assert Result.objects.filter(evaluation=evaluation).count() == 1, point
            assert len(traces_of(evaluation)) == 1, point


def test_a_stopping_worker_hands_its_evaluation_back_at_once(submit, control, broker_url):
    with control.worker(broker_url) as worker:
        control.hold_at("running")
        evaluation = submit()
        control.held()
        os.kill(worker.pid, signal.SIGTERM)
        assert worker.wait(15) == 0
        evaluation.refresh_from_db()
        assert (evaluation.state, evaluation.attempt) == (State.QUEUED, 0)
        assert not session_of(worker.pid)


@pytest.mark.soak  # a stopped one that drives: the test above
def test_an_idle_worker_stopped_by_group_ends_quietly(submit, control, broker_url):
    with control.worker(broker_url) as worker:
        first = submit()
        wait_for(lambda: finished(first), 30, control.log)
        os.killpg(worker.pid, signal.SIGTERM)
        assert worker.wait(15) == 0
        assert not session_of(worker.pid)
    assert "exited with" not in control.log.read_text()


def test_a_stopping_worker_does_not_run_a_prefetched_task(submit, control, broker_url):
    """Celery's main process then reads nothing more from its pool: the process must not wait for it, either."""
    broker = Redis(unix_socket_path=broker_url.removeprefix("redis+socket://"))
    broker.flushall()  # messages that killed workers of other tests had not acknowledged
    with broker, control.worker(broker_url) as worker:
        first = submit()
        wait_for(lambda: finished(first), 30, control.log)
        wait_for(lambda: not (broker.llen("celery") or broker.hlen("unacked")), 30, control.log)
        (process,) = (pid for pid in session_of(worker.pid) if parent_of(pid) == worker.pid)
        with suspended(process):
            second = submit(seed=1)
            wait_for(lambda: broker.hlen("unacked"), 10, control.log)
            os.kill(worker.pid, signal.SIGTERM)
            wait_for(lambda: threads_of(worker.pid) > 1, 10, control.log)  # Celery starts one for its wait
        assert worker.wait(10) == 0
        assert not session_of(worker.pid)
    second.refresh_from_db()
    assert (second.state, second.attempt) == (State.QUEUED, 0)


def test_an_owner_stops_an_evaluation_that_a_worker_is_running(submit, control, broker_url):
    with control.worker(broker_url):
        control.hold_at("running")
        evaluation = submit()
        control.held()
        assert stop_evaluation(evaluation=evaluation, now=timezone.now())
        following = submit(seed=1)
        wait_for(lambda: finished(following), 30, control.log)  # so the worker let go of the first
    evaluation.refresh_from_db()
    assert evaluation.state == State.STOPPED
    assert not Result.objects.filter(evaluation=evaluation).exists()


@pytest.mark.soak
@killed_at
def test_a_killed_duel_leaves_the_files_of_one_attempt(submit_duel, control, broker_url, points):
    with control.worker(broker_url):
        for point in points:
            evaluation = finished_after_a_kill_at(point, submit_duel, control)
            result = Result.objects.get(evaluation=evaluation)
            kept = [result.trace, result.bots, result.rivals.get().trace]
            assert sorted(traces_of(evaluation)) == sorted(os.path.basename(file.name) for file in kept), point


def test_a_killed_or_stopped_run_leaves_no_sandboxed_process(alice, oval, control, broker_url):
    cars = 3  # each in a process of its own
    car = house_cars()[0]
    files = [UploadPart(path.name, BytesIO(path.read_bytes())) for path in (car.onnx, car.metadata)]
    model = upload_model(owner=alice, files=files, now=timezone.now()).model
    long_run = RaceRules(race_type="head_to_head", laps=10_000, max_simulated_ms=100_000_000)
    run = {"owner": alice, "model": model, "rivals": [model] * (cars - 1), "track": oval, "rules": long_run}

    def on_track(worker, attempt):
        """The processes below the worker, once the car drives."""
        driving = Evaluation.objects.filter(attempt=attempt, state=State.RUNNING).exclude(progress={})
        wait_for(driving.exists, 60, control.log)
        family = family_of(worker.pid) - {worker.pid}
        commands = [Path(f"/proc/{pid}/cmdline").read_bytes() for pid in family]
        # the interpreter's own process; bubblewrap's, where there is one, has the module in its command too
        inside = [command for command in commands if command.split(b"\0")[0].rpartition(b"/")[2] != b"bwrap"]
        assert sum(b"policy_process" in command for command in inside) == cars
        assert sum(b"runner_process" in command for command in inside) == 1
        return family

    def gone(family):
        return not any(is_running(pid) for pid in family)

    with control.worker(broker_url, REAL_RUNS="1") as worker:
        evaluation = queue_evaluation(**run, now=timezone.now())
        family = on_track(worker, attempt=1)
        assert WorkerNode.objects.get().proof["exact"], "it proved itself before it took work"
        (pool_process,) = (pid for pid in family if parent_of(pid) == worker.pid)
        os.kill(pool_process, signal.SIGKILL)
        wait_for(lambda: gone(family), 30, control.log)

        lose_patience()
        sweep_now()
        family = on_track(worker, attempt=2)
        (pool_process,) = (pid for pid in family if parent_of(pid) == worker.pid)
        assert stop_evaluation(evaluation=evaluation, now=timezone.now())
        wait_for(lambda: gone(family - {pool_process}), 30, control.log)
        assert is_running(pool_process)

        queue_evaluation(**run, now=timezone.now())
        family = on_track(worker, attempt=1) | {worker.pid}
        os.kill(worker.pid, signal.SIGKILL)
        wait_for(lambda: gone(family), 30, control.log)
    assert not Result.objects.exists()

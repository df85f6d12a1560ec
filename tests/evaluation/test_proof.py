"""A worker proves that it computes as every other before it takes work, and refuses it, visibly, where it does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from threading import Barrier, BrokenBarrierError

import pytest
from django.utils import timezone

from evaluation import tasks
from evaluation.models import Evaluation, State, WorkerNode
from evaluation.running import pipeline, proof
from evaluation.running.proof import Proof
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.worker_nodes import note_worker, start_worker
from evaluation.sandbox import probe as probing
from paddock.errors import PlatformFault
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from tests.evaluation.stubs import finishes
from tests.other_bullet import install_other_bullet
from tests.proven import take_as_proven
from tests.rows import model_row
from training.golden.proof import prove as golden_runs

EXACT = Proof(ENGINE_ID, 3, 3)
INEXACT = Proof(ENGINE_ID, 3, 1, ("a duel", "two eyes"), "a duel: trace_sha256 of car 0 is this and was that")
UNSETTLED = Proof(ENGINE_ID, 3, 0, ("a duel", "two eyes", "a lap"), "a duel: this host was too busy", settled=False)


@pytest.fixture
def proves() -> Iterator[Callable[..., list[Proof]]]:
    """Have this process prove one thing after another; the list of what was proven so far."""

    def register(*found: Proof) -> list[Proof]:
        asked: list[Proof] = []

        def prover() -> Proof:
            asked.append(found[len(asked)])
            return asked[-1]

        proof.register(prover)
        return asked

    yield register
    take_as_proven()


# --- once ----------------------------------------------------------------------------------------------------------


def test_a_process_proves_itself_only_once(proves):
    asked = proves(INEXACT)
    assert proof.prove() is proof.prove() is INEXACT
    assert len(asked) == 1


def test_threads_of_a_worker_share_one_proof(proves):
    asked = proves(EXACT)
    begun = Barrier(3)
    prover = proof._prover

    def slowly() -> Proof:
        with suppress(BrokenBarrierError):
            begun.wait(0.5)  # until another thread is here, too
        return prover()

    proof.register(slowly)
    with ThreadPoolExecutor(3) as threads:
        assert list(threads.map(lambda _: proof.prove(), range(3))) == [EXACT] * 3
    assert len(asked) == 1


def test_an_unsettled_proof_is_tried_again(proves):
    asked = proves(UNSETTLED, EXACT)
    assert proof.prove() is UNSETTLED
    assert proof.prove() is proof.prove() is EXACT
    assert len(asked) == 2


@pytest.mark.django_db
def test_without_golden_runs_every_worker_takes_work(proves):
    proof.register(None)
    assert proof.prove() is None
    assert note_worker(name="w@one").proof == {}


def test_a_proof_survives_the_database():
    assert Proof.from_dict(INEXACT.to_dict()) == INEXACT
    assert not INEXACT.to_dict()["exact"] and EXACT.to_dict()["exact"]


# --- the worker's row ----------------------------------------------------------------------------------------------


@pytest.mark.django_db
class TestWorkerProof:
    def test_an_exact_worker_says_so_in_its_row(self, proves):
        proves(EXACT)
        node = note_worker(name="w@one")
        assert node.proof == {**EXACT.to_dict(), "allowed": False} and not node.refuses

    def test_an_inexact_worker_refuses_and_names_differing_runs(self, proves):
        proves(INEXACT)
        with pytest.raises(PlatformFault) as caught:
            note_worker(name="w@one")
        assert caught.value.code == "worker_inexact"
        assert caught.value.params == {"equal": 1, "runs": 3, "engine": ENGINE_ID}
        assert caught.value.__notes__ == [INEXACT.why]
        node = WorkerNode.objects.get()
        assert node.refuses and node.proof["differ"] == ["a duel", "two eyes"]

    def test_an_allowed_inexact_worker_works_and_says_so(self, proves, settings):
        settings.INEXACT_WORKERS = "allow"
        proves(INEXACT)
        node = note_worker(name="w@one")
        assert not node.refuses
        assert (node.proof["exact"], node.proof["allowed"], node.proof["equal"]) == (False, True, 1)

    def test_one_proof_serves_all_processes_of_a_worker(self, proves):
        proves(EXACT)
        note_worker(name="w@one")
        asked = proves()  # another process of the same pool
        note_worker(name="w@one")
        assert asked == []
        proves(INEXACT)
        with pytest.raises(PlatformFault):
            note_worker(name="w@two")  # another worker proves itself

    def test_a_restarted_worker_proves_itself_again(self, proves):
        proves(EXACT)
        note_worker(name="w@one")
        start_worker(name="w@one", queues=["celery"], processes=1)
        proves(INEXACT)
        with pytest.raises(PlatformFault):
            note_worker(name="w@one")

    def test_a_worker_with_another_engine_proves_itself_again(self, proves):
        WorkerNode.objects.create(
            name="w@one", seen_at=timezone.now(), proof={**Proof("paddock-v0", 3, 3).to_dict(), "allowed": False}
        )
        asked = proves(EXACT)
        assert note_worker(name="w@one").proof["engine"] == ENGINE_ID
        assert len(asked) == 1

    def test_a_worker_below_the_minimum_sandbox_drives_nothing(self, proves, monkeypatch):
        asked = proves(EXACT)
        monkeypatch.setattr(
            probing, "probe", lambda: probing.SandboxReport([probing.Layer("Landlock", False, "none")], 0, 2)
        )
        with pytest.raises(PlatformFault, match="cannot sandbox"):
            note_worker(name="w@one")
        assert asked == [] and WorkerNode.objects.get().refuses

    def test_a_worker_without_untrusted_code_needs_no_proof(self, proves):
        asked = proves(INEXACT)
        assert not note_worker(name="video-worker@one", sandboxed=False).refuses
        assert asked == []


# --- work ----------------------------------------------------------------------------------------------------------


@pytest.mark.django_db(transaction=True)
def test_an_inexact_worker_leaves_evaluations_to_others(alice, oval, wakes, proves, monkeypatch, caplog):
    monkeypatch.setattr(pipeline, "evaluate", finishes)
    monkeypatch.setattr(tasks, "_refusal", "")
    queued = queue_evaluation(owner=alice, model=model_row(alice), track=oval, rules=RaceRules(), now=timezone.now())
    proves(INEXACT)
    assert tasks.work.apply().get() == 0
    queued.refresh_from_db()
    assert (queued.state, queued.attempt, queued.reason_code) == (State.QUEUED, 0, "")
    assert "runs nothing: This worker's results differ from the reference: only 1 of 3 golden runs" in caplog.text
    assert INEXACT.why in caplog.text
    proves(EXACT)
    assert tasks.work.apply().get() == 1
    assert Evaluation.objects.get().state == State.FINISHED


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
def test_a_worker_whose_bullet_differs_takes_no_work(alice, oval, wakes, proves, monkeypatch, tmp_path, caplog):
    queued = queue_evaluation(owner=alice, model=model_row(alice), track=oval, rules=RaceRules(), now=timezone.now())
    install_other_bullet(tmp_path / "bullet", monkeypatch)
    proof.register(golden_runs)
    assert tasks.work.apply().get() == 0
    queued.refresh_from_db()
    assert (queued.state, queued.attempt) == (State.QUEUED, 0)
    node = WorkerNode.objects.get()
    assert node.refuses and node.proof["equal"] == 0 and "trace_sha256 of car 0 is" in caplog.text


@pytest.mark.django_db
def test_an_inexact_trainer_leaves_trainings_to_others(proves, settings, caplog):
    from training import tasks as trainer

    settings.TRAINING, settings.TRAINING_PAUSED = True, False
    proves(INEXACT)
    assert trainer.train.apply().get() is False
    assert "trains nothing: This worker's results differ" in caplog.text

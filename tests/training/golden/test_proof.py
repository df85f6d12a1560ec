"""What a worker drives to prove itself, and what it makes of a host that is not exact."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from paddock import exact
from paddock.errors import PlatformFault, UserFault
from paddock.simulator.engine import ENGINE_ID
from tests.other_bullet import install_other_bullet
from tests.sandbox.conftest import nothing_left  # noqa: F401
from tests.shared import CHECKOUT
from training import apps
from training.golden import proof, table
from training.golden.runs import PROOF

pytestmark = pytest.mark.usefixtures("nothing_left")
driven = cache(proof.through_the_pipeline)  # where a test is about what is made of the runs


def test_this_machine_is_exact(monkeypatch):
    monkeypatch.setattr(proof, "through_the_pipeline", driven)
    found = proof.prove()
    assert (found.engine, found.runs, found.equal, found.differ, found.why) == (
        ENGINE_ID,
        len(PROOF),
        len(PROOF),
        (),
        "",
    )
    assert found.exact and found.settled


@pytest.mark.skipif("avx512f" not in Path("/proc/cpuinfo").read_text(), reason="nothing is pinned away here")
def test_a_host_without_effective_pins_is_not_exact(monkeypatch):
    monkeypatch.setattr(exact, "environment", lambda given: dict(given))
    found = proof.prove()
    assert not found.exact and found.settled
    assert found.differ == PROOF
    assert "trace_sha256 of car 0 is" in found.why


def test_a_bullet_that_rounds_differently_is_not_exact(monkeypatch, tmp_path):
    install_other_bullet(tmp_path / "bullet", monkeypatch)
    found = proof.prove()
    assert not found.exact and found.settled
    assert found.differ == PROOF
    assert "trace_sha256 of car 0 is" in found.why


def test_an_engine_without_a_table_proves_nothing(monkeypatch, tmp_path):
    monkeypatch.setattr(proof, "through_the_pipeline", driven)
    monkeypatch.setattr(table, "TABLES", tmp_path)
    found = proof.prove()
    assert (found.equal, found.differ) == (0, PROOF)
    assert found.why == f"{PROOF[0]}: the table of {ENGINE_ID} has no such run"


def ends_in(monkeypatch, fault):
    def drive(run):
        raise fault

    monkeypatch.setattr(proof, "through_the_pipeline", drive)
    return proof.prove()


@pytest.mark.parametrize("code", ["runner_died", "policy_died"])
def test_a_missing_instruction_gives_a_readable_refusal(monkeypatch, code):
    kind = PlatformFault if code == "runner_died" else UserFault
    found = ends_in(monkeypatch, kind(code, how="killed by SIGILL", step=0))
    assert (found.equal, found.settled) == (0, True)
    assert found.why.startswith(PROOF[0]) and "SIGILL" in found.why


@pytest.mark.parametrize("error", [PlatformFault("host_overloaded"), OSError("no more files")])
def test_a_passing_failure_leaves_the_proof_unsettled(monkeypatch, error):
    found = ends_in(monkeypatch, error)
    assert (found.equal, found.settled) == (0, False) and str(error) in found.why


@pytest.mark.slow
def test_a_worker_keeps_nothing_of_its_golden_runs():
    """They need ONNX and its runtime, which the worker itself never needs."""
    code = (
        "import django, sys; django.setup(); from evaluation.running.proof import prove; found = prove();"
        "print(found.exact, found.runs, 'onnx' in sys.modules, 'onnxruntime' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1:] == ["True 3 False False"], done.stderr


def test_golden_runs_whose_process_was_killed_are_driven_again(monkeypatch):
    monkeypatch.setattr(apps.sys, "executable", "/bin/false")
    found = apps._prove()
    assert (found.exact, found.settled) == (False, False) and "status 1" in found.why

"""Workers that are taken to have proven themselves, where a test puts something else in the place of the pipeline."""

from __future__ import annotations

from evaluation.running import proof
from paddock.simulator.engine import ENGINE_ID


def take_as_proven() -> None:
    """From now on this process is exact, and drives nothing to show it."""
    proof.register(lambda: proof.Proof(ENGINE_ID, runs=3, equal=3))

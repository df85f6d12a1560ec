"""The few golden runs by which a worker shows that it computes as every other (:mod:`evaluation.proof`)."""

from __future__ import annotations

import logging

from evaluation.proof import Proof
from paddock.errors import PaddockError
from paddock.simulator.engine import ENGINE_ID

from . import table
from .drive import through_the_pipeline
from .runs import PROOF, GoldenRun, runs_of

logger = logging.getLogger(__name__)

# What a processor's missing instruction or a foreign C library ends in: to try again would end in the same.
_LASTING = ("runner_died", "policy_died", "policy_refused", "runner_error")


def prove() -> Proof:
    """Drive :data:`.runs.PROOF` in the sandbox and compare with the engine's table. Raises nothing: whatever goes
    wrong is a run that is not equal."""
    runs = runs_of(PROOF)
    try:
        rows = table.rows_of()
    except FileNotFoundError:
        rows = {}
    said: dict[str, str] = {}
    settled = True
    for run in runs:
        try:
            difference = table.difference(rows.get(run.name), run, through_the_pipeline(run))
        except PaddockError as fault:
            difference = f"{run.name}: {fault}"
            settled = settled and fault.code in _LASTING
        except Exception as error:  # a worker that cannot say why it refuses work would seem to sleep
            logger.exception("A golden run could not be driven.")
            difference, settled = f"{run.name}: {type(error).__name__}: {error}", False
        if difference:
            said[run.name] = difference
    return _proof(runs, said, settled)


def _proof(runs: list[GoldenRun], said: dict[str, str], settled: bool) -> Proof:
    return Proof(
        ENGINE_ID, len(runs), len(runs) - len(said), tuple(said), next(iter(said.values()), ""), settled or not said
    )

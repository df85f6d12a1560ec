"""The golden runs by which a worker proves that it computes the same results (:mod:`evaluation.running.proof`)."""

import json
import logging

from evaluation.running.proof import Proof
from paddock.errors import PaddockError
from paddock.simulator.engine import ENGINE_ID

from . import table
from .drive import through_the_pipeline
from .runs import PROOF, runs_of

logger = logging.getLogger(__name__)

# The faults of a processor's missing instruction or a foreign C library, which another try would meet again
_LASTING = ("runner_died", "policy_died", "policy_refused", "runner_error")


def prove() -> Proof:
    """Drive :data:`.runs.PROOF` in the sandbox and compare with the engine's table. Raises nothing: a run with an error
    is not equal."""
    runs = runs_of(PROOF)
    try:
        rows = table.rows_of()
    except FileNotFoundError:
        rows = {}
    differences: dict[str, str] = {}
    settled = True
    for run in runs:
        try:
            difference = table.difference(rows.get(run.name), run, through_the_pipeline(run))
        except PaddockError as fault:
            difference = f"{run.name}: {fault}"
            settled = settled and fault.code in _LASTING
        except Exception as error:  # without a reason the worker would seem idle
            logger.exception("A golden run could not be driven.")
            difference, settled = f"{run.name}: {type(error).__name__}: {error}", False
        if difference:
            differences[run.name] = difference
    equal, first = len(runs) - len(differences), next(iter(differences.values()), "")
    return Proof(ENGINE_ID, len(runs), equal, tuple(differences), first, settled or not differences)


if __name__ == "__main__":
    print(json.dumps(prove().to_dict()))

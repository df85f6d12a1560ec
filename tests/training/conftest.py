"""What tests of training share."""

from __future__ import annotations

import pytest

from paddock.errors import UserFault
from tests.wakeups import heard
from training.jobs.services import worker as work
from training.trainer.client import Ended, SavedState

from .jobs import an_iteration


@pytest.fixture
def training_wakes(monkeypatch) -> list[dict]:
    """Every wake-up of a trainer, instead of a broker."""
    return heard(monkeypatch, "training.tasks.train")


@pytest.fixture
def trainer(monkeypatch):
    """In place of the sandboxed process: two iterations, the first the best; then whatever ``at_the_end`` does."""

    class Trainer:
        def __init__(self) -> None:
            self.starts: list[str] = []
            self._turn = None
            self.at_the_end = lambda: Ended("time", 200, 2.0, b"zip")

        def take_over(self, turn) -> None:
            """The next time do this instead."""
            self._turn = turn

        def __call__(self, spec, listener, *, start, blob, asked_to_stop, abandoned):
            if self._turn is not None:
                return self._turn(spec, listener)
            self.starts.append(start)
            listener.ready()
            first, second = an_iteration(1), an_iteration(2, is_best=False)
            listener.iteration(type(first)(first.values, first.driving, self.networks[0], b"gz"))
            listener.checkpoint(SavedState(1, 100, 1.0, b"state"))
            listener.iteration(type(second)(second.values, second.driving, self.networks[1], b""))
            if abandoned():
                raise UserFault("stopped")
            return self.at_the_end()

    made = Trainer()
    monkeypatch.setattr(work, "train", made)
    return made

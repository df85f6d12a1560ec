"""A trainer's process for tests that kill it: ``python -m tests.training.train_worker``."""

from __future__ import annotations

import django

django.setup()

from training.jobs.services.worker import run_next_training  # noqa: E402

if __name__ == "__main__":
    run_next_training(worker="to be killed")

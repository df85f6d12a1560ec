"""Celery only sends wake-ups: a message says that there may be work. The queue is the table of evaluations."""

import os

from celery import Celery
from celery.signals import beat_init, setup_logging, worker_init

from evaluation.heartbeat import WorkerHeartbeat

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
app = Celery("paddock")
app.config_from_object("django.conf:settings", namespace="CELERY")
app.autodiscover_tasks()
app.steps["consumer"].add(WorkerHeartbeat)


@setup_logging.connect
def leave_logging_to_django(**kwargs: object) -> None:
    """A receiver is all it takes: Celery then leaves the loggers of settings.LOGGING alone."""


@worker_init.connect
@beat_init.connect
def keep_files_private(**kwargs: object) -> None:
    """What a worker or the clock writes is its owner's alone."""
    os.umask(0o077)

"""Lists that are written by hand beside another have an entry for each of its members."""

from __future__ import annotations

from django.conf import settings

from config.celery import app
from config.operations.run import programs
from core.jobs.kinds import all_kinds


def test_celery_beat_sends_the_tasks_of_every_kind_of_job():
    """A wake-up may be lost: the sweep of a kind stands beside its task, and Beat sends it."""
    sent = {entry["task"] for entry in settings.CELERY_BEAT_SCHEDULE.values()}
    rooms = {task.rpartition(".")[0] for task in sent}
    assert {kind.task.rpartition(".")[0] for kind in all_kinds()} <= rooms


def test_each_queue_of_jobs_has_a_program_of_manage_py_run_that_listens_to_it(settings):
    settings.TRAINING, settings.VIDEOS, settings.EMBEDDED_BROKER = True, True, False
    heard = set()
    for command in programs("127.0.0.1", 8000).values():
        if "worker" in command:
            named = command[command.index("--queues") + 1] if "--queues" in command else app.conf.task_default_queue
            heard |= set(named.split(","))
    assert heard == {kind.queue for kind in all_kinds()}

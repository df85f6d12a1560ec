"""The Celery app. Messages only wake workers: the queue is the table of jobs."""

import os

from celery import Celery, Task
from celery.schedules import crontab
from celery.signals import beat_init, before_task_publish, setup_logging, task_prerun, worker_init

from core.logs.lines import NONE, request_id
from evaluation.running.heartbeat import WITH_SCHEDULER, EmbeddedScheduler, WorkerHeartbeat

from .middleware.request_ids import begin
from .serving import broker_transport

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
broker_transport.use()
app = Celery("paddock")
app.config_from_object("django.conf:settings", namespace="CELERY")
app.autodiscover_tasks()
app.steps["consumer"].add(WorkerHeartbeat)
app.steps["worker"].add(EmbeddedScheduler)
app.user_options["worker"].add(WITH_SCHEDULER)


@app.on_after_configure.connect
def make_crontabs(sender: Celery, **kwargs: object) -> None:
    """The settings name times of day without Celery, which most commands never load."""
    for entry in sender.conf.beat_schedule.values():
        if isinstance(entry["schedule"], dict):
            entry["schedule"] = crontab(**entry["schedule"])


@setup_logging.connect
def leave_logging_to_django(**kwargs: object) -> None:
    """A receiver is all it takes: Celery then leaves the loggers of settings.LOGGING alone."""


@before_task_publish.connect
def send_request_id(headers: dict[str, object], **kwargs: object) -> None:
    """A task that a request wakes logs under the id of that request."""
    if request_id.get() != NONE:
        headers["request_id"] = request_id.get()


@task_prerun.connect
def begin_request(task_id: str, task: Task, **kwargs: object) -> None:
    """Any other task has its own id."""
    begin(str(task.request.get("request_id") or task_id))


@worker_init.connect
@beat_init.connect
def keep_files_private(**kwargs: object) -> None:
    """What a worker or the clock writes is its owner's alone."""
    os.umask(0o077)

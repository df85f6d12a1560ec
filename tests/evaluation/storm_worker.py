"""Workers without Celery that crash and dawdle at random: ``python -m tests.evaluation.storm_worker NUMBER``.

They run evaluations until none is left that has not ended. Now and then one is killed at a random point, and another
takes its place; now and then one stops beating for longer than its lease lasts and then comes with a late result. They
print what they did. All are forks of one process, which waits for them.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import threading

import django

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
django.setup()

from django.conf import settings  # noqa: E402
from django.db.models import F  # noqa: E402
from django.utils import timezone  # noqa: E402

from core.wakeups import workers as wakeup  # noqa: E402
from evaluation.models import Evaluation, State  # noqa: E402
from evaluation.running import pipeline  # noqa: E402
from evaluation.running.queue import jobs  # noqa: E402
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation  # noqa: E402
from evaluation.running.queue.worker import run_next_evaluation  # noqa: E402
from evaluation.signals import evaluation_ended  # noqa: E402
from paddock.errors import PlatformFault, UserFault  # noqa: E402
from tests.evaluation.stubs import car_outcome, outcome_of  # noqa: E402
from tests.storms import ride_out  # noqa: E402

LEASE_S = 1.0
CRASH, DAWDLE, OUR_FAULT, USER_FAULT = 0.012, 0.03, 0.02, 0.03
luck = random.Random()
pause = threading.Event().wait


def say(what: str) -> None:
    print(what, flush=True)


def perhaps_die(where: str) -> None:
    if luck.random() < CRASH:
        say(f"crash {where}")
        os.kill(os.getpid(), signal.SIGKILL)


def evaluate(job, on_progress=None, should_stop=lambda: False, wall_limit_s=0.0, pool=None):
    perhaps_die("running")
    draw = luck.random()
    if draw < OUR_FAULT:
        raise PlatformFault("storage_failed")
    refuse(job.rules.seed)
    pause(luck.random() * 0.01)
    return driven(job.rules.seed, len(job.rivals))


def refuse(seed: int) -> None:
    """Some evaluations fail through their network's fault, told by their seeds."""
    if seed % 100 < USER_FAULT * 100:
        raise UserFault("policy_died", step=1, how="signal 11")


def driven(seed: int, rivals: int):
    """What came of an evaluation, told by its seed."""
    cars = [car_outcome(salt=seed + number) for number in range(1, rivals + 1)]
    return outcome_of(salt=seed, rivals=cars, layout={"boxes": [], "bots": [[[seed, 0, 0]]]})


def store_files_and_perhaps_die(*args, store=jobs.store_files):
    name = store(*args)
    perhaps_die("stored")
    return name


def count_the_end(evaluation, **kwargs):
    """Receivers write in the same transaction: this counts how often an end took effect."""
    Evaluation.objects.filter(pk=evaluation.pk).update(priority=F("priority") + 1)
    perhaps_die("finishing")


def dawdle(evaluation) -> None:
    """Hold a lease without a beat until it has run out, and then try to end it. Where nobody has swept meanwhile, the
    late end counts."""
    pause(LEASE_S * 1.5)
    seed = evaluation.spec["rules"]["seed"]
    held = {"pk": evaluation.pk, "lease": evaluation.lease}
    try:
        refuse(seed)
    except UserFault as fault:
        late = EVALUATIONS.fail(**held, fault=fault, now=timezone.now())
    else:
        outcome = driven(seed, evaluation.rivals.count())
        late = finish_evaluation(**held, outcome=outcome, now=timezone.now())
    say("late accepted" if late else "late refused")


def worker() -> None:
    while Evaluation.objects.filter(state__in=(State.QUEUED, State.RUNNING)).exists():
        EVALUATIONS.sweep(now=timezone.now(), wake=False)
        if luck.random() < DAWDLE:
            evaluation = EVALUATIONS.claim(worker="dawdler", now=timezone.now())
            if evaluation is not None:
                dawdle(evaluation)
        elif not run_next_evaluation(worker=f"w{os.getpid()}"):
            pause(0.1)
    say("done")


def main(workers: int) -> None:
    settings.LEASE_SECONDS = LEASE_S
    settings.EVALUATION_MAX_ATTEMPTS = 1000
    pipeline.evaluate = evaluate
    jobs.store_files = store_files_and_perhaps_die
    wakeup.send = lambda *_, **__: None
    jobs.Evaluations.beat_s = 0.1
    evaluation_ended.connect(count_the_end, weak=False)
    ride_out(workers, worker, luck)


main(int(sys.argv[1]))

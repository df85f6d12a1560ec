"""``python -m benchmarks.deadline [--json]``: 500 students hand in during the last ten minutes before a deadline.

The hour is replayed in simulated time with the real services: hand in, claim, end of a run with its mark, and the draw
of hidden tracks. Runs take recorded durations instead of being driven. Then students click twice at once, from two
threads, where one attempt is allowed. Measured are, within one run, milliseconds of the processor with the time of
PostgreSQL's process: handing in, early and late in the ten minutes, and the end of a run with a mark beside one
without; and how well the queue foretold when each attempt would be judged. Runs on a fresh SQLite database, or
with ``--postgres`` on a fresh PostgreSQL server.
"""

from __future__ import annotations

import heapq
import os
import random
import statistics
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from functools import partial
from typing import Any

from .board import database, processor_clock
from .report import command, report

STUDENTS, WORKERS = 500, 8
MINUTES = 10
# Seconds that ``paddock evaluate`` took for five laps of the house cars on two tracks, with boxes, and with bots
RECORDED_S = (1.9, 2.4, 2.5, 2.9, 3.4, 6.3)
DOUBLES = 20
# what is promised: of the last hundred attempts by the first hundred, and of an end with a mark by one without
GROWTH, WITH_MARK = 2.0, 3.0
FORETOLD = (0.5, 2.0)  # of the time that was waited, in the median


def measure(students: int, workers: int) -> dict[str, Any]:
    """The figures of one replayed hour. Django is set up on an empty database."""
    from django.conf import settings
    from django.db import connection

    from core.wakeups import streams
    from core.wakeups import workers as wakeups

    load = os.getloadavg()[0]
    settings.WORKER_CONCURRENCY = workers
    wakeups.publish = lambda name, **options: None  # there is no broker
    streams._publish = lambda message: False
    found = {"students": students, "workers": workers, "database": connection.vendor}
    found |= _Hour(students, workers).replay()
    found["doubled"] = double_clicks(DOUBLES)
    found["machine"] = {"cores": len(os.sched_getaffinity(0)), "load": [load, os.getloadavg()[0]]}
    return found


class _Hour:
    """The simulated time before and after the deadline. Events are ``(moment, number, what)``, the earliest first."""

    def __init__(self, students: int, workers: int) -> None:
        from django.utils import timezone

        from courses.attempts.services import add_reference
        from tests.courses.assignments import a_group, a_part, an_assignment
        from tests.factories import a_model, a_racer, a_track
        from tests.rows import track_row

        self.free, self.number = workers, 0
        self.events: list[tuple[datetime, int, Callable[[datetime], object]]] = []
        self.due = timezone.now() + timedelta(days=1)
        begin = self.due - timedelta(minutes=MINUTES)
        self.draw, self.clock = random.Random(1), processor_clock()
        teacher = a_racer("teacher")
        self.group, self.students = a_group(teacher, students, begin)
        hidden = [(track_row(slug), "candidate") for slug in _tracks(3)]
        parts = [
            a_part(pass_params={"laps": 5}, tracks=[(a_track(), "shown"), *hidden], hidden_tracks=1),
            a_part(rules={"laps": 5, "race_type": "object_avoidance", "random_boxes": 3}),
        ]
        self.assignment = an_assignment(
            self.group, begin, due_at=self.due, time_zone="Europe/Berlin", parts=parts, late_points_a_day=20
        )
        reference = {"assignment": self.assignment, "by": teacher, "label": "Teacher", "model": a_model(teacher)}
        self.at(begin - timedelta(minutes=1), lambda now: add_reference(now=now, **reference))
        self.models = {racer.pk: a_model(racer) for racer in self.students}
        # more and more towards the deadline; the last one at its very second
        seconds = sorted(MINUTES * 60 * (1 - self.draw.random() ** 2) for _racer in self.students[1:])
        for racer, at in zip(self.students, [*seconds, MINUTES * 60.0], strict=True):
            self.at(begin + timedelta(seconds=at), partial(self.hand_in, racer))
        self.at(self.due + timedelta(seconds=10), self.draw_tracks)
        self.submit_ms: list[float] = []
        self.end_ms: list[float] = []
        self.plain_ms: list[float] = []
        self.foretold: dict[int, tuple[datetime, float]] = {}
        self.judged: dict[int, datetime] = {}

    def at(self, moment: datetime, what: Callable[[datetime], object]) -> None:
        self.number += 1
        heapq.heappush(self.events, (moment, self.number, what))

    def replay(self) -> dict[str, Any]:
        from courses.attempts.draws import complete_all_marks
        from courses.models import AttemptRun, Mark

        now = self.due
        while self.events:
            now, _number, what = heapq.heappop(self.events)
            what(now)
            self.claim(now)
        complete_all_marks(now=now + timedelta(seconds=10))
        marks = Mark.objects.filter(assignment=self.assignment)
        ratios = [
            (self.judged[pk] - asked).total_seconds() / told
            for pk, (asked, told) in self.foretold.items()
            if told and pk in self.judged
        ]
        few = max(1, len(self.submit_ms) // 5)
        first, last = (statistics.median(part) for part in (self.submit_ms[:few], self.submit_ms[-few:]))
        return {
            "attempts": len(self.submit_ms),
            "runs": AttemptRun.objects.filter(attempt__assignment=self.assignment).count(),
            "judged_s_after_the_deadline": (now - self.due).total_seconds(),
            "complete_marks": marks.filter(is_complete=True).count(),
            "late_marks": marks.filter(late_days__gt=0).count(),
            "untold": len(self.students) - len(self.foretold),
            "waited_by_foretold": statistics.median(ratios),
            "hand_in_ms": {"first": first, "last": last, "ratio": last / first},
            "run_end_ms": _pair(self.plain_ms, self.end_ms),
        }

    def hand_in(self, racer: Any, now: datetime) -> None:
        from django.db import transaction

        from courses.attempts.services import submit_attempt
        from evaluation.running.queue.selectors import expected_wait_s

        began = self.clock()
        attempt = submit_attempt(assignment=self.assignment, racer=racer, model=self.models[racer.pk], now=now)
        self.submit_ms.append((self.clock() - began) * 1000)
        with transaction.atomic():  # reads anew: simulated seconds pass faster than what pages share
            runs = [run.evaluation for run in attempt.runs.select_related("evaluation") if run.evaluation]
            waits = [wait for run in runs if (wait := expected_wait_s(run)) is not None]
        if len(waits) == len(runs):
            self.foretold[attempt.pk] = now, max(waits)

    def claim(self, now: datetime) -> None:
        """Free workers take what waits."""
        from evaluation.running.queue.jobs import EVALUATIONS

        while self.free and (run := EVALUATIONS.claim(worker="bench", now=now)) is not None:
            self.free -= 1
            took = timedelta(seconds=self.draw.choice(RECORDED_S))
            self.at(now + took, partial(self.end, run))

    def end(self, run: Any, now: datetime) -> None:
        """Every tenth end is measured without the receiver that computes marks first, and then undone."""
        from courses.models import AttemptRun
        from evaluation.running.queue.jobs import finish_evaluation
        from tests.factories import laps, outcome

        driven = outcome(laps(*(9000 + self.draw.randrange(900) for _lap in range(5))))

        def finish() -> float:
            began = self.clock()
            assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=driven, now=now)
            return (self.clock() - began) * 1000

        if self.number % 10 == 0:
            with _undone(), _without_marks():
                self.plain_ms.append(finish())
            with _undone():
                self.end_ms.append(finish())
        finish()
        self.free += 1
        attempt = AttemptRun.objects.select_related("attempt").get(evaluation=run.pk).attempt_id
        shown = AttemptRun.objects.filter(attempt=attempt, part_track__kind="shown", state="waiting")
        if attempt not in self.judged and not shown.exists():
            self.judged[attempt] = now

    def draw_tracks(self, now: datetime) -> None:
        from courses.attempts.draws import draw_hidden_tracks

        assert draw_hidden_tracks(now=now) == 1


@contextmanager
def _undone() -> Iterator[None]:
    from django.db import transaction

    with transaction.atomic():
        yield
        transaction.set_rollback(True)


@contextmanager
def _without_marks() -> Iterator[None]:
    from courses.attempts.services import take_ended_evaluation
    from evaluation.signals import evaluation_ended

    uid = "courses.take_ended_evaluation"
    evaluation_ended.disconnect(dispatch_uid=uid)
    try:
        yield
    finally:
        evaluation_ended.connect(take_ended_evaluation, dispatch_uid=uid)


def double_clicks(students: int) -> dict[str, int]:
    """Each of these hands in two cars at once where one attempt is allowed: what was accepted and refused."""
    from django.db import connections
    from django.utils import timezone

    from courses.attempts.services import submit_attempt
    from courses.models import Attempt
    from paddock.errors import UserFault
    from tests.courses.assignments import a_group, an_assignment
    from tests.factories import a_model, a_racer

    now = timezone.now()
    group, racers = a_group(a_racer("doubles"), students, now, "Doubles")
    assignment = an_assignment(group, now, attempts_in_all=1)
    refused: list[str] = []

    def click(racer: Any, model: Any, barrier: threading.Barrier) -> None:
        barrier.wait()
        try:
            submit_attempt(assignment=assignment, racer=racer, model=model, now=now)
        except UserFault as fault:
            refused.append(fault.code)
        finally:
            connections.close_all()

    for racer in racers:
        barrier = threading.Barrier(2)
        clicks = [threading.Thread(target=click, args=(racer, a_model(racer), barrier)) for _click in range(2)]
        for one in clicks:
            one.start()
        for one in clicks:
            one.join()
    accepted = Attempt.objects.filter(assignment=assignment).count()
    return {"students": students, "accepted": accepted, "refused": refused.count("attempts_used_up")}


def _tracks(count: int) -> list[str]:
    from paddock.geometry.catalogue import CATALOGUE

    return [track.slug for track in CATALOGUE if track.slug != "oval" and not track.is_open][:count]


def _pair(plain: list[float], marked: list[float]) -> dict[str, float]:
    without, with_mark = statistics.median(plain), statistics.median(marked)
    return {"without": without, "with_mark": with_mark, "ratio": with_mark / without}


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    found, students, doubled = [], figures["students"], figures["doubled"]
    if figures["complete_marks"] != students:
        found.append(f"{students - figures['complete_marks']} marks are not complete after the last run")
    if figures["late_marks"]:
        found.append(f"{figures['late_marks']} attempts in time were marked late")
    if (doubled["accepted"], doubled["refused"]) != (doubled["students"], doubled["students"]):
        found.append(f"{doubled['accepted']} attempts of {doubled['students']} students who may make one each")
    if figures["hand_in_ms"]["ratio"] > GROWTH:
        found.append(f"handing in takes {figures['hand_in_ms']['ratio']:.2f} times as long at the end")
    if figures["run_end_ms"]["ratio"] > WITH_MARK:
        found.append(f"an end with a mark takes {figures['run_end_ms']['ratio']:.2f} times as long")
    if not FORETOLD[0] <= figures["waited_by_foretold"] <= FORETOLD[1]:
        found.append(f"attempts waited {figures['waited_by_foretold']:.2f} times as long as foretold")
    return found


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    hand_in, end, doubled = figures["hand_in_ms"], figures["run_end_ms"], figures["doubled"]
    before, after = figures["machine"]["load"]
    return "\n".join(
        [
            f"{figures['students']} students, {figures['workers']} workers, {figures['database']}",
            f"{'attempts, runs':34}{figures['attempts']:>14,}{figures['runs']:>14,}",
            f"{'last run after the deadline':34}{figures['judged_s_after_the_deadline']:>12.0f} s",
            f"{'complete marks, late marks':34}{figures['complete_marks']:>14,}{figures['late_marks']:>14,}",
            f"{'told nothing of their wait':34}{figures['untold']:>14,}",
            f"{'waited by foretold, median':34}{figures['waited_by_foretold']:>14.2f}",
            f"{'hand in, first and last fifth':34}{hand_in['first']:>11.2f} ms{hand_in['last']:>11.2f} ms"
            f"{hand_in['ratio']:>8.2f}",
            f"{'end of a run, without and with mark':34}{end['without']:>10.2f} ms{end['with_mark']:>11.2f} ms"
            f"{end['ratio']:>8.2f}",
            f"{'double clicks, accepted, refused':34}{doubled['students']:>14,}{doubled['accepted']:>14,}"
            f"{doubled['refused']:>8,}",
            f"{figures['machine']['cores']} cores, load {before:.1f} before and {after:.1f} after",
        ]
    )


def main(arguments: list[str] | None = None) -> int:
    """Set up a database, measure, print; 1 when a promise is not kept."""
    parser = command("deadline", "500 students hand in during the last ten minutes.")
    parser.add_argument("--students", type=int, default=STUDENTS)
    parser.add_argument("--workers", type=int, default=WORKERS)
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server that is started for it")
    options = parser.parse_args(arguments)
    with database(options.postgres):
        figures = measure(options.students, options.workers)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())

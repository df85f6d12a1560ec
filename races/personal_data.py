"""Personal data of races: results stay, without the name."""

from datetime import datetime
from typing import Any

from django.db.models import JSONField, QuerySet, Sum

from core.personal_data.discarding import discard_files
from core.personal_data.retention import RetentionPolicy
from core.personal_data.rules import NEEDED, OF_THE_RACE, OTHERS, SECRET, Leaving, PersonalData, register
from evaluation.models import Evaluation, StoredFile
from evaluation.running.results import files_of_runs
from paddock.errors import UserFault

from . import models as races
from .entries.services.entries import withdraw
from .events import record_board
from .test_runs.services import delete_own

_UNDER_WAY = (races.RaceState.UPCOMING, races.RaceState.OPEN)


def _check(racer: Any, now: datetime) -> None:
    """Raises UserFault("account_organises") while a race of the racer's is not over."""
    for race in races.Race.objects.filter(organiser=racer, cancelled_at=None):
        event = races.LiveEvent.objects.filter(race=race, ended_at=None).first()
        if race.state_at(now) in _UNDER_WAY or (event is not None and not event.is_over):
            raise UserFault("account_organises", race=race.name)


def _erase(leaving: Leaving) -> None:
    """Leave races without a result, and delete private runs. Runs in races stay: results can be verified."""
    entries = races.Entry.objects.filter(racer=leaving.racer)
    unused = entries.filter(submissions=None, timed_sessions=None)
    for entry in entries.select_related("race"):
        if entry.race.state_at(leaving.now) not in _UNDER_WAY:
            continue
        if unused.filter(pk=entry.pk).exists():
            withdraw(entry=entry, now=leaving.now)
        record_board(entry.race)
    races.Guest.objects.filter(entry__in=entries).update(name=leaving.nameless)
    for entry in unused.filter(duel_cars=None, live_racers=None):
        entry.delete()
    runs = Evaluation.with_sealed.filter(owner=leaving.racer).exclude(pk__in=_runs_in_races())
    races.OwnEvaluation.objects.filter(owner=leaving.racer).delete()
    files = files_of_runs(runs.values_list("pk", flat=True))
    runs.delete()
    StoredFile.objects.filter(name__in=files).delete()
    discard_files(files, now=leaving.now)


def _runs_in_races() -> Any:
    """The ids of runs that belong to a race: submissions, duels, live runs and reruns."""
    ways = [
        *((races.Submission, "evaluation"), (races.Duel, "evaluation"), (races.LiveSlot, "evaluation")),
        *((races.LiveSlot, "speed_run"), (races.Redrive, "evaluation"), (races.Redrive, "replaced")),
    ]
    first, *others = (model._base_manager.exclude(**{way: None}).order_by().values(way) for model, way in ways)
    return first.union(*others)


def _old_test_runs(before: datetime, now: datetime) -> QuerySet[races.OwnEvaluation]:
    return races.OwnEvaluation.objects.filter(evaluation__ended_at__lt=before)


def _delete_test_runs(rows: QuerySet[races.OwnEvaluation], now: datetime) -> int:
    deleted = 0
    for own in rows.select_related("evaluation"):
        delete_own(own=own, now=now)
        deleted += 1
    return deleted


def _weight_of_runs(rows: QuerySet[races.OwnEvaluation]) -> int:
    files = files_of_runs(rows.values_list("evaluation", flat=True))
    return StoredFile.objects.filter(name__in=files).aggregate(size=Sum("size"))["size"] or 0


_LOG = " ".join(column.name for column in races.LiveLog._meta.fields if isinstance(column, JSONField))

register(
    "races",
    PersonalData(races.WatchedRace, owner="racer", rows=True, section="watched_races"),
    PersonalData(races.Timekeeper, owner="racer", rows=True, section="timekeeping"),
    PersonalData(races.RefusedCar, owner="racer", rows=True, section="refused_cars"),
    PersonalData(
        races.OwnEvaluation,
        owner="owner",
        rows=True,
        section="test_runs",
        exported="submit_reason_params",
    ),
    PersonalData(
        races.Race,
        owner="organiser",
        erased="organiser",
        kept={OF_THE_RACE: "rules boxes sensors name description prize sponsor terms cancel_reason"},
        section="races_organised",
        exported="rules boxes sensors name description prize sponsor terms cancel_reason",
    ),
    PersonalData(races.RaceTerms, kept={OF_THE_RACE: "text"}),
    PersonalData(
        races.Recheck,
        owner="evaluation__owner",
        kept={NEEDED: "reason_params operator_detail differences measured_sha256"},
        withheld={"It is a check of the site's own machines.": "*"},
    ),
    PersonalData(
        races.Entry,
        owner="racer",
        erased="removal_reason",
        anonymised="racer",
        kept={"Only entries of guests without an account have one.": "guest_name", OF_THE_RACE: "sectors"},
        section="entries",
        exported="removal_reason guest_name sectors",
    ),
    PersonalData(races.Submission, owner="entry__racer", section="submissions"),
    PersonalData(races.DuelCompetitor, owner="entry__racer", section="duels"),
    PersonalData(
        races.Retiming,
        owner="entry__racer",
        kept={OF_THE_RACE: "reason_params"},
        section="retimings",
        exported="reason_params",
    ),
    PersonalData(races.TermsAcceptance, owner="entry__racer", section="accepted_terms"),
    PersonalData(
        races.LiveEvent,
        anonymised="planned_by",
        kept={OF_THE_RACE: "message"},
        mentions="message",
    ),
    PersonalData(
        races.LiveRacer,
        owner="entry__racer",
        anonymised="deputy",
        kept={OF_THE_RACE: "speed"},
        section="live_events",
        exported="speed",
        withheld={OTHERS: "deputy"},
    ),
    PersonalData(races.LiveSlot, kept={OF_THE_RACE: "speed_log speed_next speed_wish"}),
    PersonalData(
        races.LiveLog,
        anonymised="by",
        kept={OF_THE_RACE: _LOG},
        mentions=_LOG,
    ),
    PersonalData(
        races.Guest,
        owner="entry__racer",
        anonymised="name",
        kept={"Its link can no longer be used once an account has the results.": "claim"},
        section="claimed_guests",
        exported="name",
        withheld={SECRET: "claim"},
    ),
    PersonalData(
        races.TimingSensor,
        anonymised="made_by",
        kept={"It names a device.": "name", SECRET: "token_sha256 hint"},
    ),
    PersonalData(
        races.TimedSession,
        owner="entry__racer",
        erased="car",
        anonymised="timekeeper",
        section="timed_sessions",
        exported="car",
        withheld={OTHERS: "timekeeper"},
    ),
    PersonalData(
        races.MeasuredLap,
        owner="session__entry__racer",
        kept={OF_THE_RACE: "note"},
        section="measured_laps",
        exported="note",
    ),
    PersonalData(
        races.LapCorrection,
        owner="lap__session__entry__racer",
        anonymised="by",
        kept={"It is the reason of a corrected result.": "reason before after"},
        mentions="reason",
        section="lap_corrections",
        exported="reason before after",
        withheld={OTHERS: "by"},
    ),
    check=_check,
    erase=_erase,
    policies=[RetentionPolicy("test_runs", "TEST_RUNS_KEPT_DAYS", _old_test_runs, _delete_test_runs, _weight_of_runs)],
)

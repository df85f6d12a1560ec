"""Personal data of the ground floor."""

from ..api.models import StoredAnswer
from ..events.models import Event
from ..jobs.models import WorkerHold
from .rules import NOBODY, PersonalData, register

register(
    "core",
    PersonalData(
        StoredAnswer,
        owner="racer",
        rows=True,
        mentions="body",
        withheld={"Answers of the API, kept for a day in case a program repeats its request.": "*"},
    ),
    PersonalData(
        Event,
        owner="racer",
        anonymised="racer",
        kept={"It is about the race or the run, and is deleted after some weeks.": "data"},
        mentions="data",
        section="events",
        exported="data",
    ),
    PersonalData(WorkerHold, kept={NOBODY: "worker"}),
)

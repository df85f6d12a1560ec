"""Personal data of the ground floor."""

from ..api.models import StoredAnswer
from ..audit.models import AuditEntry
from ..events.models import Event
from ..events.reading import trim
from ..jobs.models import WorkerHold
from .models import DiscardedFile
from .retention import RetentionPolicy
from .rules import NOBODY, PersonalData, register

register(
    "core",
    PersonalData(
        StoredAnswer,
        owner="racer",
        rows=True,
        withheld={"Answers of the API, kept for a day in case a program repeats its request.": "*"},
    ),
    PersonalData(
        AuditEntry,
        owner="actor racer",
        anonymised="actor racer",
        kept={
            "It is the record of an act, which nobody changes; names and addresses of persons are not copied to it.": (
                "action program target_kind target_id target_name changes request network"
            )
        },
        section="audit",
        exported="action program target_kind target_id target_name",
        withheld={"It is about the site, or about others.": "changes request network"},
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
    PersonalData(DiscardedFile, kept={NOBODY: "name"}),
    policies=[
        RetentionPolicy(
            "events",
            "EVENTS_KEPT_DAYS",
            lambda before, now: Event.objects.filter(recorded_at__lt=before),
            lambda rows, now: trim(now=now),
        )
    ],
)

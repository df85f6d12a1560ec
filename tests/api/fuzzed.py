"""Everything that addresses of the API may name, all of it Alice's, and tokens of all who may ask."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import pytest
from django.conf import settings as django_settings
from django.utils import timezone
from knox.models import AuthToken

from accounts.class_accounts.services import make_class
from accounts.groups.services import make_group
from accounts.models import Racer
from accounts.programs.services import make_program, make_program_token
from accounts.teams.services import found_team
from core.events import waking
from core.wakeups import workers as wakeup
from league.models import Notice
from league.notices import kinds as notice_kinds
from league.seasons.services.seasons import create_season, schedule_round
from league.webhooks.services import add_webhook, send_test
from races.entries.services.entries import accept_invitation
from races.models import Visibility
from races.timing.services import make_sensor
from tests.courses.assignments import assigned_to_students
from tests.drawn_runs import a_drawing
from tests.evaluation.reports import a_report
from tests.factories import a_race, a_racer, drive, laps
from tests.races.timing import a_physical_race, timed
from tests.training.jobs import a_sweep_row, a_trained_one
from training.vehicles.services import save_vehicle
from videos import drawing
from videos.services import request_video, run_next_video


@dataclass
class Fuzzed:
    """``known``: what addresses may name, so that requests also get past the first 404: all of it is Alice's.
    ``tokens``: the headers of everybody who may ask: a guest, a stranger, the owner of all that there is, an admin."""

    known: dict[str, Any]
    tokens: dict[str, dict[str, str]]

    def names(self, path: str) -> dict[str, Any]:
        """What is filled into this path of the schema."""
        names = re.findall(r"{(\w+)}", path)
        kind, *below = (part for part in path.split("/")[3:] if not part.startswith("{"))
        known = {"race": "any", **self.known}
        if kind == "assignments":
            known |= known["assigned"]["all"] | known["assigned"].get(below[0] if below else "", {})
        elif kind in known:
            known |= {"public_id": known[kind], "number": known[kind]}
        if kind == "programs":
            known |= {"alias": known["programs"], "key": known["programs_key"]}
        if kind == "classes":
            known["slug"] = known[kind]
        if kind == "races" and {"id", "number"} & set(names):  # of the race of real cars
            known["slug"] = "real"
        return {name: known.get(name) for name in names}

    def fill(self, path: str) -> str:
        """An address: what all of the path names is there."""
        return path.format(**self.names(path))


def make_fuzzed() -> Fuzzed:
    """Without a broker, and with a video of a few bytes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wakeup, "publish", lambda name, **options: None)
        patch.setattr(waking, "wake", lambda name: None)
        patch.setattr(drawing, "write_video", a_drawing)
        patch.setattr(drawing, "poster", lambda scene: b"a still")
        patch.setattr(django_settings, "TRAINING", True)
        patch.setattr(django_settings, "TRAINING_PAUSED", False)
        alice, sam = a_racer("alice"), a_racer("sam", is_staff=True, is_superuser=True)
        return Fuzzed(make_known(alice, sam), make_tokens(alice, sam))


def make_known(alice: Racer, sam: Racer) -> dict[str, Any]:
    now = timezone.now()
    race = a_race(now, slug="fuzzed", organiser=alice, visibility=Visibility.INVITATION)
    accept_invitation(token=race.invitation, racer=a_racer("guest"), now=now)
    season = create_season(slug="fuzzed", name="Fuzzed", starts_on=now.date(), ends_on=now.date() + timedelta(days=90))
    times = {"opens_at": now + timedelta(days=1), "closes_at": now + timedelta(days=9)}
    schedule_round(season=season, number=1, division="open", now=now, name="Month", track=race.track, **times)
    submission = drive(race, alice, laps(10_000, 10_000, 10_000), now)
    asked = request_video(evaluation=submission.evaluation, by=alice, part="1", language="en", now=now)
    run_next_video(worker="w")
    notice = Notice.objects.create(racer=alice, kind=notice_kinds.OPENS, about="x", params={"race": "Fuzzed"}, at=now)
    real = a_physical_race(now, slug="real", organiser=alice)
    sensor = make_sensor(race=real, name="Gate", by=alice, now=now)[0]
    session = timed(real, alice, alice, now, 10_000)
    hook = add_webhook(owner=alice, url="https://example.org/hook")
    send_test(webhook=hook, now=now)
    make_group(by=alice, name="Fuzzed", now=now)
    found_team(by=alice, name="Fuzzed", now=now)
    program = make_program(by=sam, name="fuzzed", purpose="Results", owner="alice", now=now)
    make_class(teacher=alice, name="Fuzzed class", plan=[], now=now)
    assigned, attempt = assigned_to_students(alice, now)
    return {
        "slug": "fuzzed",
        "tracks": "oval",
        "classes": "fuzzed-class",
        "assigned": assigned,
        "attempts": attempt.public_id,
        "alias": "guest",
        "programs": program.racer.alias,
        "programs_key": make_program_token(program=program, by=sam, scopes=["read"], days=1, now=now)[0].token_key,
        "stage": "open-qualifier",
        "token": race.invitation,
        "evaluations": submission.evaluation.public_id,
        "models": submission.evaluation.model.public_id,
        "videos": asked.video.public_id,
        "reports": a_report(alice, now).public_id,
        "trainings": a_trained_one(alice, race.track, now).public_id,
        "sweeps": a_sweep_row(alice, race.track, now).public_id,
        "vehicles": save_vehicle(owner=alice, name="Van", sensors=["STEREO_CAMERAS"]).public_id,
        "notices": notice.pk,
        "webhooks": hook.pk,
        "key": AuthToken.objects.create(user=alice)[0].token_key,
        "id": str(session.pk),
        "number": str(sensor.pk),
    }


def make_tokens(alice: Racer, sam: Racer) -> dict[str, dict[str, str]]:
    """Nothing compressed: the library that checks the answers does not unpack them."""
    plain = {"Accept-Encoding": "identity"}

    def header(racer: Racer) -> dict[str, str]:
        return plain | {"Authorization": f"Token {AuthToken.objects.create(user=racer)[1]}"}

    return {"guest": plain, "stranger": header(a_racer("charlie")), "owner": header(alice), "staff": header(sam)}

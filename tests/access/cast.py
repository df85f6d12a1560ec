"""The cast whose access is tested, the objects that addresses name, and one request as one of the cast.

All objects are the organiser's, and every race but ``{open}`` is by invitation; the member has joined these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import pytest
from allauth.mfa.recovery_codes.internal.auth import RecoveryCodes
from allauth.mfa.totp.internal.auth import TOTP
from django.conf import settings as django_settings
from django.core.cache import cache
from django.core.files import File
from django.db import connection, transaction
from django.http import HttpResponseBase
from django.test import Client
from django.test.client import ClientHandler

from accounts.class_accounts.services import add_teacher
from accounts.models import ClassLearner, Classroom, Racer
from accounts.programs.services import make_program, make_program_token
from accounts.tokens.services import create_token, note_use
from core.events import waking
from core.wakeups import workers as wakeup
from courses.assignments.services import change_assignment, extend, make_submission_group
from courses.attempts.services import add_reference
from courses.marks.services import propose_regrade
from courses.models import Assignment
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from league.models import Cup, Notice, Round, Season, Stage
from league.notices import kinds as notice_kinds
from races.entries.services.entries import accept_invitation, enter_race
from races.live.services import launch
from races.models import Entry, LiveEvent, LiveSlot, Race, Visibility
from races.test_runs.services import drive_own
from races.timing.services import make_sensor
from races.web.spectator_links import spectator_token
from tests.clients import logged_in
from tests.courses.assignments import a_part
from tests.drawn_runs import a_drawing
from tests.duels import drawn
from tests.factories import a_model, a_race, a_racer, laps, start
from tests.factories import outcome as driven
from tests.live_shows import a_live_race, a_show, an_ended_show, begun, compute, slot_of
from tests.pages.conftest import make_world
from tests.pages.form_world import Cast as Forms
from tests.reference_laps import a_reference
from videos import drawing

VIEWERS = ("guest", "stranger", "member", "pupil", "teacher", "organiser", "bare", "staff")
# words for what everybody may know of
PUBLIC = {
    *("open", "racer", "track", "season", "round", "day", "stage", "guide", "lesson"),
    *("team", "mate", "invitee", "gone", "driven", "ready", "waits", "shared"),
}
# what every request of a browser or a program may write: its session, and when its token was used
NOTED = ("django_session", "accounts_tokengrant")
HANDLER, FORGED = (ClientHandler(enforce_csrf_checks=checked) for checked in (False, True))
WRITING = ("INSERT", "UPDATE", "DELETE", "REPLACE")


@dataclass(frozen=True)
class Answer:
    """``status``: as in the table; ``written``: the tables whose rows the request wrote."""

    status: str
    response: HttpResponseBase
    written: set[str]

    def __str__(self) -> str:
        return f"{self.status}+" if self.written else self.status


@dataclass
class Cast:
    """``words``: what addresses of the table name. By viewer: ``tokens``, headers of programs; ``sessions``, keys of
    browsers; ``models``, the public id of a model of theirs."""

    racers: dict[str, Racer | None]
    sessions: dict[str, str]
    models: dict[str, str]
    tokens: dict[str, dict[str, str]]
    words: dict[str, str]
    sensor_token: str
    forms: dict[str, dict[str, Any]] = field(default_factory=dict)  # of pages, by address

    def __deepcopy__(self, memo: dict[int, Any]) -> Cast:
        return self  # no test changes it

    def ask(
        self,
        viewer: str,
        method: str,
        address: str,
        body: Any = None,
        *,
        form: bool = False,
        forged: bool = False,
        headers: dict[str, str] | None = None,
    ) -> Answer:
        """Send a request, to the API with a token and to a page with a session, and take back what it did. ``form``:
        the body of an operation is no JSON; ``forged``: with a session in any case, from a page of another site."""
        client, is_api = Client(raise_request_exception=False), address.startswith("/api/v1/")
        client.handler, headers = FORGED if forged else HANDLER, headers or {}
        if is_api and not forged:
            headers = self.tokens[viewer] | headers
            if "/timing/crossings/" in address and viewer == "organiser":
                headers["authorization"] = f"Bearer {self.sensor_token}"
        elif viewer in self.sessions:
            client.cookies[django_settings.SESSION_COOKIE_NAME] = self.sessions[viewer]
        options = {"content_type": "application/json"} if is_api and method != "GET" and not form else {}
        _rewind(body or {})
        cache.clear()
        written = Written()
        with transaction.atomic(), connection.execute_wrapper(written):
            response = getattr(client, method.lower())(address, body, headers=headers, **options)
            transaction.set_rollback(True)
        return Answer(outcome(response), response, written.tables - set(NOTED))

    def fill(self, template: str, viewer: str = "organiser") -> str:
        """The words of a template in place; ``{mine}`` is a model of this viewer."""
        return template.format(**self.words | {"mine": self.models.get(viewer, "none")})


class Written:
    """Notes the tables whose rows statements insert, change or delete."""

    def __init__(self) -> None:
        self.tables: set[str] = set()

    def __call__(self, execute: Any, sql: str, params: Any, many: bool, context: Any) -> Any:
        words = sql.replace('"', " ").split(maxsplit=5)
        if words and words[0].upper() in WRITING:
            self.tables.add(next(word for word in words[1:] if "_" in word))
        return execute(sql, params, many, context)


def _rewind(body: dict[str, Any]) -> None:
    for value in body.values():
        for file in value if isinstance(value, list) else [value]:
            if isinstance(file, File):
                file.seek(0)


def outcome(answer: HttpResponseBase) -> str:
    """The status, or the page of refusal that a browser is sent to."""
    where = answer.headers.get("Location", "")
    for path, word in (("/accounts/login/", "login"), ("/admin/login/", "login"), ("/class/", "class")):
        if where.startswith(path):
            return word
    return "2fa" if where == "/accounts/2fa/" else str(answer.status_code)


def make_cast() -> Cast:
    """Without a broker, and with videos of a few bytes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wakeup, "publish", lambda name, **options: None)
        patch.setattr(waking, "wake", lambda name: None)
        patch.setattr(drawing, "write_video", a_drawing)
        patch.setattr(drawing, "poster", lambda scene: b"a still")
        patch.setattr(django_settings, "TRAINING", True)
        patch.setattr(django_settings, "TRAINING_PAUSED", False)
        return _made_cast()


def _made_cast() -> Cast:
    world = make_world()
    forms, now, alice = Forms(world), world.now, world.alice
    member, tess = a_racer("member"), a_racer("teacher")
    bare = a_racer("bare", is_staff=True, is_superuser=True)
    TOTP.activate(world.admin, "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ")
    RecoveryCodes.activate(world.admin)
    classroom = Classroom.objects.get()
    add_teacher(classroom=classroom, by=alice, alias="teacher", now=now)
    accept_invitation(token=world.secret.invitation, racer=member, now=now)
    enter_race(race=world.race, racer=member, now=now)
    season = Season.objects.get()
    ahead = a_race(now, slug="ahead", kind="league", division="open", opens_at=now + timedelta(days=2))
    Round.objects.create(season=season, number=9, stage=Stage.OPEN, race=ahead)
    Cup.objects.create(day=now.date() - timedelta(days=1), race=a_race(now, slug="a-cup"), over_at=now)
    show = begun(
        a_show(
            now,
            alice,
            ["member", "coming"],
            race=a_live_race(now, alice, slug="show", name="Show"),
            order="as_entered",
            speed_control=True,
        ),
        alice,
        now,
    )
    playing, coming = slot_of(show, "member"), slot_of(show, "coming")
    for slot in (playing, coming):
        compute(slot, now, 13_457, 12_861)
    launch(event=show, slot=playing, by=alice, seen=None, now=now - timedelta(seconds=12))
    ended = an_ended_show(now, alice).race
    planned = a_show(now, alice, ["member"], race=a_live_race(now, alice, slug="planned", name="Planned"))
    duels = drawn(now - timedelta(hours=2), 3, slug="drawn", name="Drawn", organiser=alice)
    for race in (forms.real, duels, ended):
        Entry.objects.create(race=race, racer=member, entered_at=now)
    private = [show.race.pk, planned.race_id, forms.real.pk, duels.pk, ended.pk]
    Race.objects.filter(pk__in=private).update(visibility=Visibility.INVITATION)
    alice.quotas.create(name="own_runs_at_once", limit=9)
    drove, compared, waiting = (
        drive_own(owner=alice, model=world.model, track=world.track, now=now).evaluation for _ in range(3)
    )
    for run in (drove, compared):
        running = start(run, now)
        finish_evaluation(pk=run.pk, lease=running.lease, outcome=driven(laps(20_000, 21_000, 19_000)), now=now)
    notice = Notice.objects.create(racer=alice, kind=notice_kinds.OPENS, about="x", params={"race": "Open"}, at=now)
    token, _ = create_token(racer=alice, now=now)
    program = make_program(by=world.admin, name="ci", purpose="Results", owner="alice", now=now)
    program_token, _ = make_program_token(program=program, by=world.admin, scopes=["read"], days=7, now=now)
    sensor, sensor_token = make_sensor(race=forms.real, name="Line", by=alice, now=now)
    a_reference(world.track, 20_000, now, world.track.direction)
    exceptions = exceptions_of(alice, forms.words["assignment"], now)
    uid, key = forms.words["reset"].split("-", 1)
    words = forms.words | {
        "open": "open-race",
        "secret": "secret-race",
        "program": program.racer.alias,
        "program_key": program_token.token_key,
        "show": "show",
        "planned": "planned",
        "shown": ended.slug,
        "real": forms.real.slug,
        "duel": "drawn",
        "gone": "gone",
        "racer": "bob",
        "track": "oval",
        "season": season.slug,
        "round": ahead.slug,
        "stage": "open-qualifier",
        "day": str(now.date() - timedelta(days=1)),
        "team": "comets",
        "group": forms.group.slug,
        "class": "7c",
        "card": "ABCDEFGHJKMN",
        "lesson": "agent",
        "guide": "tracks",
        "spectators": spectator_token(world.secret),
        "playing": run_of(playing),
        "coming": run_of(coming),
        "drove": drove.public_id,
        "compared": compared.public_id,
        "waiting": waiting.public_id,
        "slot": str(playing.pk),
        "version": str(LiveEvent.objects.get(pk=show.pk).version),
        "race_id": str(world.secret.pk),
        "show_id": str(show.race_id),
        "season_id": str(season.pk),
        "racer_id": str(alice.pk),
        "notice": str(notice.pk),
        "webhook": str(alice.webhooks.get().pk),
        "token": token.token_key,
        "sensor": str(sensor.pk),
        "lap": str(forms.lap.pk),
        "session": str(forms.lap.session_id),
        "joined": "member",
        "mate": "comet-1",
        "invitee": "newcomer",
        "learner": ClassLearner.objects.latest("pk").racer.alias,
        "co_teacher": "teacher",
        "guest": str(forms.tom.pk),
        "uid": uid,
        "key": key,
        **exceptions,
    }
    racers = {
        "guest": None,
        "stranger": a_racer("stranger"),
        "member": member,
        "pupil": ClassLearner.objects.earliest("pk").racer,
        "teacher": tess,
        "organiser": alice,
        "bare": bare,
        "staff": world.admin,
    }
    known = {viewer: racer for viewer, racer in racers.items() if racer is not None}
    return Cast(
        racers,
        {viewer: logged_in(racer).session.session_key for viewer, racer in known.items()},
        {viewer: a_model(racer).public_id for viewer, racer in known.items()},
        {viewer: _header(racer, now) for viewer, racer in racers.items()},
        words,
        sensor_token,
    )


def exceptions_of(teacher: Racer, public_id: str, now: datetime) -> dict[str, str]:
    """An extension and a submission group of the latest learner, a reference row, and a regrade; their numbers."""
    assignment = Assignment.objects.get(public_id=public_id)
    ann, by = ClassLearner.objects.latest("pk").racer, {"assignment": assignment, "by": teacher, "now": now}
    extend(racer=ann, due_at=assignment.due_at + timedelta(days=2), last_at=None, reason="ill", **by)
    together = make_submission_group(name="Red", racers=[ann], **by)
    reference = add_reference(label="Teacher", model=a_model(teacher), **by)
    change_assignment(parts=[a_part(points=50)], **by)
    regrade = propose_regrade(reason="half", **by)
    student = ClassLearner.objects.earliest("pk").racer.alias
    numbers = {"together": str(together.pk), "reference": str(reference.pk), "regrade": str(regrade.pk)}
    return numbers | {"student": student}


def run_of(slot: LiveSlot) -> str:
    """The public id of a slot's sealed run."""
    slot.refresh_from_db()
    return Evaluation.with_sealed.get(pk=slot.evaluation_id).public_id


def _header(racer: Racer | None, now: datetime) -> dict[str, str]:
    if racer is None:
        return {}
    token, text = create_token(racer=racer, now=now)
    note_use(grant=token.grant, now=now)
    return {"authorization": f"Bearer {text}"}

"""A waiting job of each kind, made by the services that queue it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import datetime, timedelta
from typing import Any

import pytest

from accounts.models import RacerGroup
from core.jobs.kinds import JobKind
from core.jobs.models import Leased
from courses.lti.scores import SCORES
from courses.models import Assignment, LtiContext, LtiLine, LtiPlatform, LtiScore
from evaluation.reports.jobs import CHUNKS
from evaluation.reports.services import request_report
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.services import queue_evaluation
from league.invitations.services import INVITATIONS, invite_by_mail
from league.models import Mail, MailInvitation, Notice, WebhookDelivery
from league.notices import kinds as notice_kinds
from league.notices.services import MAILS
from league.webhooks.deliveries import DELIVERIES
from league.webhooks.services import add_webhook
from paddock.rules.race import RaceRules
from races.models import Recheck
from races.rechecks.jobs import RECHECKS
from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from tests.rows import model_row
from tests.training.jobs import a_training
from tracks.models import ReferenceLap
from tracks.reference.jobs import REFERENCES
from training.jobs.services.queue import TRAININGS
from videos.services import VIDEOS, request_video


def an_evaluation(racer: Any, track: Any, now: datetime) -> Leased:
    return queue_evaluation(owner=racer, model=model_row(racer), track=track, rules=RaceRules(), now=now)


def a_video(racer: Any, track: Any, now: datetime) -> Leased:
    run = a_driven_run(a_race(now), racer, now)
    return request_video(evaluation=run, by=racer, language="en", now=now).video


def a_delivery(racer: Any, track: Any, now: datetime) -> Leased:
    hook = add_webhook(owner=racer, url="https://example.org/hook")
    return WebhookDelivery.objects.create(webhook=hook, event="run.finished", about="x", at=now, body="{}")


def a_chunk(racer: Any, track: Any, now: datetime) -> Leased:
    report = request_report(owner=racer, model=model_row(racer), track_set="chosen", tracks=[track], now=now)
    return report.chunks.get()


def a_mail(racer: Any, track: Any, now: datetime) -> Leased:
    notice = Notice.objects.create(racer=racer, kind=notice_kinds.OPENS, about="x", at=now)
    return Mail.objects.create(notice=notice)


def an_invitation(racer: Any, track: Any, now: datetime) -> Leased:
    race = a_race(now, organiser=racer)
    assert invite_by_mail(race=race, by=racer, addresses=["new@example.org"], language="en", now=now) == 1
    return MailInvitation.objects.get(race=race)


def a_recheck(racer: Any, track: Any, now: datetime) -> Leased:
    run = a_driven_run(a_race(now), racer, now)
    return Recheck.objects.create(day=now.date(), number=Recheck.objects.count() + 1, evaluation=run, queued_at=now)


def a_reference(racer: Any, track: Any, now: datetime) -> Leased:
    engine = f"engine-{ReferenceLap.objects.count()}"
    return ReferenceLap.objects.create(track=track, direction="ccw", engine=engine, queued_at=now)


def a_score(racer: Any, track: Any, now: datetime) -> Leased:
    platform, _made = LtiPlatform.objects.get_or_create(name="University", issuer="https://example.org", client_id="1")
    group = RacerGroup.objects.create(slug=f"group-{LtiScore.objects.count()}", name="Course", made_at=now)
    context = LtiContext.objects.create(platform=platform, deployment_id="1", context_id=group.slug, group=group)
    due = {"opens_at": now, "due_at": now + timedelta(days=1)}
    assignment = Assignment.objects.create(group=group, title="First", **due)
    line = LtiLine.objects.create(context=context, assignment=assignment)
    return LtiScore.objects.create(line=line, racer=racer, queued_at=now)


MAKERS: dict[JobKind[Any], Callable[..., Leased]] = {
    EVALUATIONS: an_evaluation,
    TRAININGS: a_training,
    VIDEOS: a_video,
    DELIVERIES: a_delivery,
    MAILS: a_mail,
    CHUNKS: a_chunk,
    INVITATIONS: an_invitation,
    RECHECKS: a_recheck,
    REFERENCES: a_reference,
    SCORES: a_score,
}


def of_each(kinds: Iterable[JobKind[Any]]) -> pytest.MarkDecorator:
    """Tests of these kinds only."""
    return pytest.mark.parametrize("kind", list(kinds), ids=lambda kind: kind.name, indirect=True)

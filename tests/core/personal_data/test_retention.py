"""Retention: each policy deletes what is older than its setting, a dry run only counts, and 0 keeps all."""

from __future__ import annotations

import json
from datetime import timedelta
from io import StringIO

import pytest
from allauth.account.models import EmailAddress
from django.conf import settings as site
from django.contrib.admin.models import LogEntry
from django.core.management import call_command

from accounts.models import KnownAddress, PastAlias, Racer, ReservedAlias
from config.tasks import retention
from core.personal_data.retention import retain
from core.personal_data.rules import all_policies
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from league.models import MailInvitation, Notice
from races.models import OwnEvaluation
from races.test_runs.services import drive_own
from tests.factories import a_model, a_race, a_racer, a_track, drive, laps, outcome, start

# Settings that keep today what was kept before there were policies.
KEPT_BEFORE = {
    "ADMIN_LOG_KEPT_DAYS": 0,
    "KNOWN_ADDRESSES_KEPT_DAYS": 0,
    "MAIL_INVITATIONS_KEPT_DAYS": 0,
    "NOTICES_KEPT_DAYS": 180,
    "PAST_ALIASES_KEPT_DAYS": 0,
    "TEST_RUNS_KEPT_DAYS": 0,
    "TRAINING_TRACES_KEPT_DAYS": 30,
    "UNCONFIRMED_ACCOUNTS_KEPT_DAYS": 0,
    "WEBHOOK_DELIVERIES_KEPT_DAYS": 30,
}


def due(now) -> dict[str, int]:
    return {one.policy.name: one.rows for one in retain(all_policies(), now=now, dry_run=True) if one.rows}


def policy(name: str):
    return [one for one in all_policies() if one.name == name]


def test_the_defaults_keep_what_was_kept():
    assert {name: getattr(site, name) for name in KEPT_BEFORE} == KEPT_BEFORE


def a_notice(racer: Racer, at) -> None:
    Notice.objects.create(racer=racer, kind="opens", about=str(at), params={}, at=at)


def a_log_entry(racer: Racer, at) -> None:
    entry = LogEntry.objects.create(user=racer, object_repr="x", action_flag=2, change_message="")
    LogEntry.objects.filter(pk=entry.pk).update(action_time=at)


def an_invitation(racer: Racer, at) -> None:
    MailInvitation.objects.create(
        race=a_race(at), email="x@example.org", made_by=racer, asked_at=at, turn=1, expires_at=at, language="en"
    )


@pytest.mark.parametrize(
    ("name", "setting", "make"),
    [
        ("notices", "NOTICES_KEPT_DAYS", a_notice),
        ("admin_log", "ADMIN_LOG_KEPT_DAYS", a_log_entry),
        ("mail_invitations", "MAIL_INVITATIONS_KEPT_DAYS", an_invitation),
        (
            "known_addresses",
            "KNOWN_ADDRESSES_KEPT_DAYS",
            lambda racer, at: KnownAddress.objects.create(racer=racer, digest=str(at), seen_at=at),
        ),
        (
            "past_aliases",
            "PAST_ALIASES_KEPT_DAYS",
            lambda racer, at: PastAlias.objects.create(racer=racer, alias="old", changed_at=at),
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_rows_go_by_their_age(name, setting, make, db, now, settings, wakes):
    racer = a_racer()
    for days in (9, 11):
        make(racer, now - timedelta(days=days))
    setattr(settings, setting, 0)
    assert name not in due(now)
    setattr(settings, setting, 10)
    assert due(now)[name] == 1
    assert retain(policy(name), now=now)[0].rows == 1
    assert name not in due(now)


def test_old_test_runs_go_with_the_weight_of_their_files(db, now, settings, wakes):
    racer = a_racer()
    own = drive_own(owner=racer, model=a_model(racer), track=a_track(), now=now)
    running = start(own.evaluation, now)
    finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome(laps(9_000)), now=now)
    raced = drive(a_race(now), racer, laps(9_000, 9_000, 9_000), now)
    settings.TEST_RUNS_KEPT_DAYS = 5
    later = now + timedelta(days=6)
    (counted,) = retain(policy("test_runs"), now=later, dry_run=True)
    assert counted.rows == 1 and counted.size > 0
    assert OwnEvaluation.objects.get().evaluation_id == running.pk
    retain(policy("test_runs"), now=later)
    assert list(Evaluation.objects.values_list("pk", flat=True)) == [raced.evaluation_id]


def test_accounts_that_were_never_confirmed_nor_used_go(db, now, settings, wakes):
    settings.UNCONFIRMED_ACCOUNTS_KEPT_DAYS = 30
    before = now - timedelta(days=31)
    unused, young = a_racer(joined_at=before), a_racer(joined_at=now)
    confirmed, uploader, house = a_racer(joined_at=before), a_racer(joined_at=before), a_racer(is_house=True)
    Racer.objects.filter(pk=house.pk).update(joined_at=before)
    EmailAddress.objects.create(user=confirmed, email=confirmed.email, verified=True, primary=True)
    a_model(uploader)
    retain(policy("unconfirmed_accounts"), now=now)
    left = set(Racer.objects.values_list("pk", flat=True))
    assert left == {young.pk, confirmed.pk, uploader.pk, house.pk} and unused.pk not in left


def test_reservations_go_when_they_end(db, now):
    ReservedAlias.objects.create(digest="a", until=now)
    ReservedAlias.objects.create(digest="b", until=now + timedelta(seconds=1))
    retain(policy("reserved_aliases"), now=now)
    assert ReservedAlias.objects.get().digest == "b"


def test_the_command_counts_in_a_dry_run_and_deletes_without(db, now, settings, wakes):
    settings.NOTICES_KEPT_DAYS = 1
    a_notice(a_racer(), now - timedelta(days=400))
    said = StringIO()
    call_command("retention", "--dry-run", "--json", stdout=said)
    rows = {one["kind"]: one for one in json.loads(said.getvalue())}
    assert rows["notices"] == {"kind": "notices", "days": 1, "rows": 1, "bytes": 0} and Notice.objects.exists()
    text = StringIO()
    call_command("retention", stdout=text)
    assert "notices" in text.getvalue() and not Notice.objects.exists()


def test_the_scheduler_applies_it_each_night(db, now, settings, wakes):
    assert site.CELERY_BEAT_SCHEDULE["retention"]["task"] == retention.name
    settings.NOTICES_KEPT_DAYS = 1
    a_notice(a_racer(), now - timedelta(days=400))
    assert retention() == 1 and not Notice.objects.exists()

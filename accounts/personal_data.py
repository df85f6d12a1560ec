"""Personal data of accounts, and of the packages that keep a part of them: log-in, second factors, tokens, sessions."""

from contextlib import suppress
from datetime import datetime

from allauth.account.models import EmailAddress, EmailConfirmation
from allauth.mfa.models import Authenticator
from django.contrib.admin.models import LogEntry
from django.contrib.auth import SESSION_KEY
from django.contrib.auth.models import Group, Permission
from django.contrib.contenttypes.models import ContentType
from django.contrib.sessions.models import Session
from django.db import transaction
from django.db.models import ProtectedError, Q, QuerySet
from knox.models import AuthToken

from core.personal_data.discarding import discard_files
from core.personal_data.retention import RetentionPolicy
from core.personal_data.rules import NOBODY, OTHERS, SECRET, Leaving, PersonalData, register
from paddock.errors import UserFault

from . import models as accounts
from .pictures.services import path_of


def _check(racer: accounts.Racer, now: datetime) -> None:
    """Raises UserFault("account_leads_class" | "account_leads_group" | "account_last_admin")."""
    classroom = accounts.Classroom.objects.filter(group__leader=racer).select_related("group").first()
    if classroom is not None:
        raise UserFault("account_leads_class", name=classroom.group.name)
    for group in accounts.RacerGroup.objects.filter(leader=racer):
        if group.members.exclude(racer=racer).filter(confirmed_at__isnull=False).exists():
            raise UserFault("account_leads_group", name=group.name)
    admins = accounts.Racer.objects.filter(is_superuser=True, is_active=True)
    if racer.is_superuser and not admins.exclude(pk=racer.pk).exists():
        raise UserFault("account_last_admin")


def _erase(leaving: Leaving) -> None:
    """Delete the picture, groups without other members, and the sessions, which hold the alias in code. Disable the
    programs of the racer."""
    racer = leaving.racer
    if racer.avatar:
        discard_files([path_of(racer.avatar)], now=leaving.now)
    for group in accounts.RacerGroup.objects.filter(leader=racer):
        with suppress(ProtectedError), transaction.atomic():
            group.delete()
    accounts.Racer.objects.filter(program__owner=racer).update(is_active=False)
    mine = [
        session.pk
        for session in Session.objects.iterator(chunk_size=500)
        if session.get_decoded().get(SESSION_KEY) == str(racer.pk)
    ]
    Session.objects.filter(pk__in=mine).delete()


def _unconfirmed(before: datetime, now: datetime) -> QuerySet[accounts.Racer]:
    """Unconfirmed accounts without any activity."""
    unused = dict.fromkeys(("entries", "models", "evaluations", "organised_races", "groups_led", "learner", "tracks"))
    found = accounts.Racer.objects.filter(
        Q(last_login=None) | Q(last_login__lt=before), joined_at__lt=before, record_id=None, guest_name="", **unused
    )
    found = found.filter(is_house=False, is_staff=False, is_superuser=False, deletion=None)
    return found.exclude(emailaddress__verified=True)


def _delete_unconfirmed(rows: QuerySet[accounts.Racer], now: datetime) -> int:
    deleted = 0
    for racer in rows:
        with suppress(ProtectedError), transaction.atomic():
            racer.delete()
            deleted += 1
    return deleted


_IN_USE = "It belongs to its members."

register(
    "accounts",
    PersonalData(
        LogEntry,
        anonymised="user",
        kept={"It is the id of the row that an admin changed.": "object_id"}
        | {"It is the record of what admins did.": "object_repr change_message"},
        mentions="object_repr change_message",
    ),
    PersonalData(Group, kept={NOBODY: "name"}),
    PersonalData(Permission, kept={NOBODY: "name codename"}),
    PersonalData(ContentType, kept={NOBODY: "app_label"}),
    PersonalData(Session, erased="session_key session_data"),
    PersonalData(EmailConfirmation, owner="email_address__user", rows=True, withheld={"The secret of a mail.": "*"}),
    PersonalData(EmailAddress, owner="user", rows=True, section="email_addresses", exported="email"),
    PersonalData(Authenticator, owner="user", rows=True, section="second_factors", withheld={SECRET: "data"}),
    PersonalData(
        AuthToken, owner="user", rows=True, section="tokens", exported="token_key", withheld={SECRET: "digest"}
    ),
    PersonalData(accounts.RacerQuota, owner="racer", rows=True, section="quotas", exported="name"),
    PersonalData(
        accounts.SignUpInvitation, anonymised="made_by", kept={"It is an admin's note.": "note", SECRET: "code"}
    ),
    PersonalData(
        accounts.KnownAddress, owner="racer", rows=True, section="known_addresses", withheld={SECRET: "digest"}
    ),
    PersonalData(
        accounts.RacerGroup,
        owner="leader",
        erased="leader",
        kept={_IN_USE: "name description", SECRET: "code"},
        section="groups_led",
        exported="name description",
        withheld={SECRET: "code"},
    ),
    PersonalData(
        accounts.GroupMember,
        owner="racer",
        rows=True,
        anonymised="confirmed_by",
        section="groups",
        withheld={OTHERS: "confirmed_by"},
    ),
    PersonalData(accounts.Classroom, kept={NOBODY: "plan"}),
    PersonalData(accounts.ClassTeacher, owner="racer", rows=True, section="classes_taught"),
    PersonalData(
        accounts.ClassLearner,
        owner="racer",
        rows=True,
        section="class",
        exported="real_name student_id lessons",
        withheld={SECRET: "code_digest"},
    ),
    PersonalData(accounts.PastAlias, owner="racer", rows=True, section="past_aliases", exported="alias"),
    PersonalData(accounts.ReservedAlias, owner="racer", rows=True, withheld={"Digests of the past aliases.": "*"}),
    PersonalData(accounts.DeletedAccount, kept={"It is the date on which an account was deleted.": "racer"}),
    PersonalData(accounts.Follow, owner="follower followed", rows=True, withheld={OTHERS: "*"}),
    PersonalData(accounts.Racer.groups.through, owner="racer", rows=True, section="roles"),
    PersonalData(accounts.Racer.user_permissions.through, owner="racer", rows=True, section="permissions"),
    PersonalData(
        accounts.Team,
        owner="captain",
        erased="captain",
        kept={_IN_USE: "name key", SECRET: "code"},
        section="teams_led",
        exported="name",
        withheld={SECRET: "code", "It is the name in lower case.": "key"},
    ),
    PersonalData(
        accounts.ServiceAccount,
        owner="owner",
        erased="owner",
        kept={"It is what a program is for.": "purpose", "It is the program's account.": "racer"},
        section="programs",
        exported="racer purpose",
    ),
    PersonalData(accounts.TeamInvitation, owner="racer", rows=True, section="team_invitations"),
    PersonalData(accounts.TeamMember, owner="racer", rows=True, section="team"),
    PersonalData(
        accounts.Racer,
        owner="pk",
        erased="password country team guest_name avatar groups user_permissions",
        anonymised="alias email",
        section="account",
        exported="alias email country team guest_name avatar",
        files=lambda racer: [path_of(racer.avatar)] if racer.avatar else [],
        withheld={SECRET: "password", "The sections roles and permissions have them.": "groups user_permissions"},
    ),
    check=_check,
    erase=_erase,
    policies=[
        RetentionPolicy("unconfirmed_accounts", "UNCONFIRMED_ACCOUNTS_KEPT_DAYS", _unconfirmed, _delete_unconfirmed),
        RetentionPolicy(
            "known_addresses",
            "KNOWN_ADDRESSES_KEPT_DAYS",
            lambda before, now: accounts.KnownAddress.objects.filter(seen_at__lt=before),
        ),
        RetentionPolicy(
            "past_aliases",
            "PAST_ALIASES_KEPT_DAYS",
            lambda before, now: accounts.PastAlias.objects.filter(changed_at__lt=before),
        ),
        RetentionPolicy(
            "reserved_aliases",
            "ALIAS_RESERVED_DAYS",
            lambda before, now: accounts.ReservedAlias.objects.filter(until__lte=now),
        ),
        RetentionPolicy(
            "admin_log",
            "ADMIN_LOG_KEPT_DAYS",
            lambda before, now: LogEntry.objects.filter(action_time__lt=before),
        ),
    ],
)

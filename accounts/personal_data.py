"""Personal data of accounts, and of the packages that keep a part of them: log-in, second factors, tokens, sessions."""

from allauth.account.models import EmailAddress, EmailConfirmation
from allauth.mfa.models import Authenticator
from django.contrib.admin.models import LogEntry
from django.contrib.auth.models import Group, Permission
from django.contrib.contenttypes.models import ContentType
from django.contrib.sessions.models import Session
from knox.models import AuthToken

from core.personal_data.rules import NOBODY, OTHERS, SECRET, PersonalData, register

from . import models as accounts

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
        exported="real_name lessons",
        withheld={SECRET: "code_digest"},
    ),
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
        withheld={SECRET: "password", "They have files of their own.": "groups user_permissions"},
    ),
)

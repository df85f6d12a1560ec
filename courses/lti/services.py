"""Writes of launches: accounts of a platform's people, the class of a course, the column for an assignment's marks."""

from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext_lazy as _

from accounts.class_accounts.services import (
    add_learners,
    add_teacher,
    can_lead_class,
    can_teach,
    free_alias,
    is_learner,
    make_class,
)
from accounts.models import Classroom, GroupMember, Racer
from accounts.signing_in.second_factor import factors_of
from core.audit.recording import audited
from core.database.locks import hold
from paddock.errors import UserFault

from ..models import Assignment, LtiAccount, LtiContext, LtiLine, LtiPlatform
from .launches import LONGEST_NAME, Launch

SCORE = "https://purl.imsglobal.org/spec/lti-ags/scope/score"


def context_of(launch: Launch) -> LtiContext | None:
    """The course that the launch came from, once a teacher has linked it."""
    rows = LtiContext.objects.select_related("group", "group__leader", "group__classroom")
    return rows.filter(platform=launch.platform, deployment_id=launch.deployment, context_id=launch.context).first()


def account_of(launch: Launch, context: LtiContext | None) -> Racer | None:
    """The account of the person who came: for students the one of this course, else their own."""
    rows = LtiAccount.objects.filter(platform=launch.platform, sub=launch.sub).select_related("racer")
    found = None
    if context is not None and not launch.is_teacher:
        found = rows.filter(context=context).first()
    found = found or rows.filter(context=None).first()
    return found.racer if found else None


def may_enter(racer: Racer) -> bool:
    """Whether a platform may log this account in: not an admin's, not one with a second factor, which it would get
    around."""
    closed = racer.is_staff or racer.is_superuser or racer.is_program or racer.is_house or not racer.is_active
    return not closed and not factors_of(racer).exists()


def may_link(racer: Racer) -> bool:
    """Whether the racer may link this account: none that a platform may not log in, nor a class's."""
    return may_enter(racer) and not is_learner(racer)


@audited("lti.account_linked", _("Account linked with a learning platform"), by="racer")
@transaction.atomic
def link_account(*, launch: Launch, racer: Racer, now: datetime) -> LtiAccount:
    """Link the logged-in racer's own account with the person who came. Raises UserFault("lti_account" |
    "lti_account_taken")."""
    hold(racer)
    if not may_link(racer):
        raise UserFault("lti_account")
    if LtiAccount.objects.filter(platform=launch.platform, racer=racer).exclude(sub=launch.sub).exists():
        raise UserFault("lti_account_taken")
    account, _made = LtiAccount.objects.get_or_create(
        platform_id=launch.platform, sub=launch.sub, context=None, defaults={"racer": racer, "linked_at": now}
    )
    if account.racer_id != racer.pk:
        raise UserFault("lti_account_taken")
    return account


@transaction.atomic
def make_teacher(*, launch: Launch, now: datetime) -> Racer:
    """An account without e-mail address and password for a teacher: only the platform logs it in."""
    hold(LtiPlatform.objects.get(pk=launch.platform))
    known = account_of(launch, None)
    if known is not None:
        return known
    racer = Racer.objects.create_user(*free_alias(), None)
    LtiAccount.objects.create(platform_id=launch.platform, sub=launch.sub, racer=racer, linked_at=now)
    return racer


@transaction.atomic
def make_student(*, launch: Launch, context: LtiContext, now: datetime) -> Racer:
    """A class account for a student, whose name only teachers see. Raises UserFault("lti_no_class" |
    "class_too_many")."""
    classroom, leader = _class_of(context)
    hold(context.group)
    known = account_of(launch, context)
    if known is not None:
        return known
    name = launch.name or launch.sub[:LONGEST_NAME]
    (card,) = add_learners(classroom=classroom, by=leader, names=[name], now=now)
    LtiAccount.objects.create(
        platform_id=launch.platform, sub=launch.sub, context=context, racer=card.learner.racer, linked_at=now
    )
    return card.learner.racer


@audited("lti.course_linked", _("Course of a learning platform linked with a class"), by="racer")
@transaction.atomic
def link_course(*, launch: Launch, racer: Racer, classroom: Classroom | None, now: datetime) -> LtiContext:
    """Link the course that a teacher came from with a class of theirs, or (None) with a new one. A course that is
    linked stays so. Raises UserFault("lti_role" | "class_not_yours" | "class_no_teacher")."""
    if not launch.is_teacher:
        raise UserFault("lti_role")
    hold(LtiPlatform.objects.get(pk=launch.platform))
    known = context_of(launch)
    if known is not None:
        return known
    if classroom is None:
        classroom = make_class(teacher=racer, name=launch.title[:64] or str(_("Course")), plan=(), now=now)
    elif not can_lead_class(racer, classroom):
        raise UserFault("class_not_yours")
    return LtiContext.objects.create(
        platform_id=launch.platform,
        deployment_id=launch.deployment,
        context_id=launch.context,
        title=launch.title,
        group=classroom.group,
        linked_at=now,
    )


@transaction.atomic
def enter_course(*, launch: Launch, context: LtiContext, racer: Racer, now: datetime) -> Assignment | None:
    """Let the racer be in the class what they are in the course, and note where its grade book is;
    the assignment that the link is for. Raises UserFault("lti_no_class" | "class_too_many_teachers")."""
    classroom, leader = _class_of(context)
    if launch.is_teacher and not can_teach(racer, classroom):
        add_teacher(classroom=classroom, by=leader, alias=racer.alias, now=now)
    elif not launch.is_teacher and not is_learner(racer):
        member = {"confirmed_at": now, "confirmed_by": leader}
        asked = GroupMember.objects.filter(group=context.group, racer=racer, confirmed_at=None)
        if not asked.update(**member):
            GroupMember.objects.get_or_create(group=context.group, racer=racer, defaults={"asked_at": now, **member})
    context.title = launch.title or context.title
    if launch.lines or launch.line:
        context.lineitems_url, context.scopes = launch.lines, list(launch.scopes)
    context.save(update_fields=["title", "lineitems_url", "scopes"])
    context.lines.update(looked_at=None)  # somebody new may have a mark already
    assignment = Assignment.objects.filter(group=context.group, public_id=launch.assignment or None).first()
    if assignment is not None and SCORE in launch.scopes:
        line, _made = LtiLine.objects.get_or_create(context=context, assignment=assignment)
        if launch.line and line.url != launch.line:
            line.url = launch.line
            line.save(update_fields=["url"])
    return assignment


def _class_of(context: LtiContext) -> tuple[Classroom, Racer]:
    """Raises UserFault("lti_no_class") where the class or its first teacher is gone."""
    classroom = Classroom.objects.filter(group=context.group).select_related("group__leader").first()
    if classroom is None or classroom.group.leader is None:
        raise UserFault("lti_no_class")
    return classroom, classroom.group.leader

"""Classes: accounts made from a list of names, log-in codes, and visibility of learners."""

import secrets
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime

from django.db import transaction
from django.db.models import Count, Exists, OuterRef, Q, QuerySet
from django.http import HttpRequest
from django.utils.crypto import salted_hmac
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from core.database.locks import hold
from core.rate_limits import address_of, count
from paddock.errors import UserFault

from ..groups.services import free_slug
from ..models import ClassLearner, Classroom, ClassTeacher, GroupMember, Racer, RacerGroup, Viewer
from ..quotas import CountedRows, Quota, Racers, limit_of, only, used_by
from ..signing_in.reserved_aliases import is_reserved

MOST_NAME = 80
MOST_TEACHERS = 5  # beside the first one
# Without what looks like something else: 31 of them to the power of 12 are 59 bits.
LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789".replace("L", "")
LENGTH = 12
WRONG_CODES = "60/5m,500/d"  # from one address, which a whole class may share
_FIRST = (
    "amber brave bright calm clever cosmic eager fast gentle golden happy keen lucky merry nimble quick quiet royal "
)
_FIRST += "silver sunny swift tidy vivid witty"
_SECOND = "badger beaver falcon fox gecko hare heron kestrel koala lemur lynx marten mole otter owl panda puffin raven "
_SECOND += "robin seal sparrow swan tiger weasel wren"


@dataclass(frozen=True)
class Card:
    """What a learner gets on paper, shown this once."""

    learner: ClassLearner
    code: str


def can_teach(viewer: Viewer, classroom: Classroom) -> bool:
    """Whether the viewer sees a class with its names: its teachers only. Twin of :func:`classes_taught_by`."""
    if can_lead_class(viewer, classroom):
        return True
    return isinstance(viewer, Racer) and ClassTeacher.objects.filter(classroom=classroom, racer=viewer).exists()


def classes_taught_by(viewer: Viewer) -> QuerySet[Classroom]:
    """Twin of :func:`can_teach`."""
    found = Classroom.objects.select_related("group")
    if not isinstance(viewer, Racer):
        return found.none()
    second = Exists(ClassTeacher.objects.filter(classroom=OuterRef("pk"), racer=viewer))
    return found.filter(Q(group__leader=viewer) | second)


def can_lead_class(viewer: Viewer, classroom: Classroom) -> bool:
    """Whether the viewer deletes a class and chooses its other teachers: its first teacher."""
    return isinstance(viewer, Racer) and classroom.group.leader_id == viewer.pk


def is_learner(racer: object) -> bool:
    return isinstance(racer, Racer) and ClassLearner.objects.filter(racer=racer).exists()


def _learners(racers: Racers, now: datetime) -> CountedRows:
    found = ClassLearner.objects.filter(classroom__group__leader__isnull=False).order_by()
    found = only(found, "classroom__group__leader", racers)
    return found.values_list("classroom__group__leader").annotate(Count("pk"))


LEARNERS = Quota(12, "learners", "LEARNERS_PER_TEACHER", _("Learners in your classes"), _learners)


@audited("class.created", _("Class created"), by="teacher")
@transaction.atomic
def make_class(*, teacher: Racer, name: str, plan: Iterable[str], now: datetime) -> Classroom:
    """Create a class led by its teacher. Raises UserFault("class_no_teacher") and ValidationError."""
    if is_learner(teacher):
        raise UserFault("class_no_teacher")
    group = RacerGroup(leader=teacher, name=name.strip(), made_at=now, slug=free_slug(name))
    group.full_clean()
    group.save()
    GroupMember.objects.create(group=group, racer=teacher, asked_at=now, confirmed_at=now, confirmed_by=teacher)
    return Classroom.objects.create(group=group, plan=list(plan), made_at=now)


def names_in(text: str) -> list[str]:
    """Names of learners, one per line. Raises UserFault("class_names") for no name and for one over the limit."""
    names = [" ".join(line.replace("\t", " ").split()) for line in text.splitlines()]
    names = [name for name in names if name]
    if not names or any(len(name) > MOST_NAME for name in names):
        raise UserFault("class_names", limit=MOST_NAME)
    return names


@audited("class.learners_added", _("Learners added to a class"), target="classroom")
@transaction.atomic
def add_learners(*, classroom: Classroom, by: Racer, names: Iterable[str], now: datetime) -> list[Card]:
    """Create an account with a neutral alias and a code for each name, all or none; a student ID may follow a name
    after a semicolon.

    Raises UserFault("class_not_yours" | "class_too_many" | "class_student_id" | "text_character").
    """
    _require_teacher(classroom, by)
    leader = classroom.group.leader or by
    hold(leader)
    names = list(names)
    limit = limit_of(leader, LEARNERS.name)
    if used_by(leader, LEARNERS.name, now) + len(names) > limit:
        raise UserFault("class_too_many", limit=limit)
    cards = []
    taken = set(classroom.learners.exclude(student_id="").values_list("student_id", flat=True))
    for line in names:
        name, student_id = (part.strip() for part in f"{line};".split(";")[:2])
        if not name or student_id in taken:
            raise UserFault("class_student_id", id=student_id)
        taken |= {student_id} - {""}
        racer = Racer.objects.create_user(*free_alias(), None)
        code = _new_code()
        learner = ClassLearner(racer=racer, classroom=classroom, real_name=name, student_id=student_id)
        learner.code_digest = digest_of(code)
        learner.save(force_insert=True)
        GroupMember.objects.create(group=classroom.group, racer=racer, asked_at=now, confirmed_at=now, confirmed_by=by)
        cards.append(Card(learner, code))
    return cards


@audited("class.student_ids_changed", _("Student IDs of a class changed"), target="classroom")
@transaction.atomic
def set_student_ids(*, classroom: Classroom, by: Racer, ids: Mapping[int, str]) -> None:
    """Set the student IDs of these learners, by the ids of their racers; ``""`` removes one. Raises
    UserFault("class_not_yours" | "class_student_id" | "text_character")."""
    _require_teacher(classroom, by)
    hold(classroom.group)
    learners = {learner.racer_id: learner for learner in classroom.learners.all()}
    wanted = {pk: " ".join(ids.get(pk, learner.student_id).split()) for pk, learner in learners.items()}
    given = [student_id for student_id in wanted.values() if student_id]
    for student_id in given:
        if len(student_id) > MOST_NAME or given.count(student_id) > 1:
            raise UserFault("class_student_id", id=student_id[:MOST_NAME])
    changed = [learner for pk, learner in learners.items() if learner.student_id != wanted[pk]]
    ClassLearner.objects.filter(pk__in=[learner.pk for learner in changed]).update(student_id="")  # two may swap
    for learner in changed:
        learner.student_id = wanted[learner.pk]
        learner.save(update_fields=["student_id"])


@audited("class.codes_replaced", _("Codes of learners replaced"), target="classroom")
@transaction.atomic
def new_codes(*, classroom: Classroom, by: Racer, learners: Collection[int] | None = None) -> list[Card]:
    """Replace the codes of these learners or of all, and end their sessions. Raises UserFault("class_not_yours")."""
    _require_teacher(classroom, by)
    found = classroom.learners.select_related("racer")
    if learners is not None:
        found = found.filter(racer__in=learners)
    cards = []
    for learner in found:
        code = _new_code()
        learner.code_digest = digest_of(code)
        learner.save(update_fields=["code_digest"])
        learner.racer.set_unusable_password()  # another one, with which sessions of before end
        learner.racer.save(update_fields=["password"])
        cards.append(Card(learner, code))
    return cards


def learner_with(request: HttpRequest, code: str) -> Racer | None:
    """Whose code it is; None for nobody's. Counts wrong ones by address. Raises UserFault("class_too_many_codes")."""
    attempt = count("accounts:class_code", address_of(request), WRONG_CODES)
    if attempt is None:
        raise UserFault("class_too_many_codes")
    digest = digest_of(plain_code(code))
    racer = Racer.objects.filter(learner__code_digest=digest, is_active=True).first()
    if racer is not None:
        attempt.rollback()
    return racer


def plain_code(text: str) -> str:
    """A code as it was made, however it was typed."""
    return "".join(letter for letter in text.upper() if letter.isalnum())[: LENGTH + 1]


def shown_code(code: str) -> str:
    """In groups of four, as it stands on cards."""
    return "-".join(code[at : at + 4] for at in range(0, len(code), 4))


def digest_of(code: str) -> str:
    """What is kept of a code: nobody reads it out of the database, nor guesses it without the site's secret."""
    return salted_hmac("accounts.classes", code, algorithm="sha256").hexdigest()


def note_lesson(*, racer: Racer, slug: str, now: datetime) -> None:
    """A learner has opened a lesson, for the first time."""
    with transaction.atomic():
        learner = ClassLearner.objects.select_for_update().filter(racer=racer).first()
        if learner is not None and slug not in learner.lessons:
            learner.lessons = {**learner.lessons, slug: now.isoformat(timespec="seconds")}
            learner.save(update_fields=["lessons"])


@audited("class.plan_changed", _("Lesson plan of a class changed"), target="classroom")
def change_plan(*, classroom: Classroom, by: Racer, plan: Iterable[str]) -> None:
    """Raises UserFault("class_not_yours")."""
    _require_teacher(classroom, by)
    classroom.plan = list(plan)
    classroom.save(update_fields=["plan"])


@audited("class.teacher_added", _("Teacher added to a class"))
@transaction.atomic
def add_teacher(*, classroom: Classroom, by: Racer, alias: str, now: datetime) -> ClassTeacher:
    """Add a second teacher; a repeated call changes nothing. Raises UserFault("class_not_yours" |
    "class_teacher_unknown" | "class_too_many_teachers")."""
    _require_leader(classroom, by)
    hold(classroom.group)
    racer = Racer.objects.filter(alias__iexact=alias.strip(), is_active=True, is_house=False).first()
    if racer is None or racer.pk == classroom.group.leader_id or is_learner(racer):
        raise UserFault("class_teacher_unknown")
    others = ClassTeacher.objects.filter(classroom=classroom).exclude(racer=racer)
    if others.count() >= MOST_TEACHERS:
        raise UserFault("class_too_many_teachers", limit=MOST_TEACHERS)
    teacher, _made = ClassTeacher.objects.get_or_create(classroom=classroom, racer=racer, defaults={"added_at": now})
    GroupMember.objects.update_or_create(
        group=classroom.group,
        racer=racer,
        defaults={"confirmed_at": now, "confirmed_by": by},
        create_defaults={"asked_at": now, "confirmed_at": now, "confirmed_by": by},
    )
    return teacher


@audited("class.teacher_removed", _("Teacher removed from a class"), target="classroom")
@transaction.atomic
def remove_teacher(*, classroom: Classroom, by: Racer, racer: Racer) -> None:
    """Take a second teacher out of the class; they may leave by themselves. Raises UserFault("class_not_yours")."""
    if by.pk != racer.pk:
        _require_leader(classroom, by)
    removed, _rows = ClassTeacher.objects.filter(classroom=classroom, racer=racer).delete()
    if removed:
        GroupMember.objects.filter(group=classroom.group, racer=racer).delete()


def _new_code() -> str:
    return "".join(secrets.choice(LETTERS) for _ in range(LENGTH))


def free_alias() -> tuple[str, str]:
    while True:
        words = secrets.choice(_FIRST.split()), secrets.choice(_SECOND.split()), str(secrets.randbelow(900) + 100)
        alias = "-".join(words)
        if not is_reserved(alias) and not Racer.objects.filter(alias__iexact=alias).exists():
            return alias, f"{alias}@learner.invalid"


def _require_leader(classroom: Classroom, by: Racer) -> None:
    if not can_lead_class(by, classroom):
        raise UserFault("class_not_yours")


def _require_teacher(classroom: Classroom, by: Racer) -> None:
    if not can_teach(by, classroom):
        raise UserFault("class_not_yours")

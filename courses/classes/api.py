"""Classes of a teacher: list, create, change, delete; learners, their cards, further teachers."""

from typing import Any

from django.db.models import Count, QuerySet
from django.shortcuts import get_object_or_404
from django.urls import reverse
from django.utils import timezone
from django.utils.cache import set_response_etag
from drf_spectacular.utils import OpenApiParameter
from rest_framework import serializers
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.class_accounts import services
from accounts.class_accounts.services import Card
from accounts.models import ClassLearner, Classroom, ClassTeacher, Racer
from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from accounts.tokens.services import may_read_secrets
from core.addresses import origin_of
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import PrivateView
from core.validators import visible_line
from paddock.errors import UserFault
from training.lessons.catalogue import LESSONS

from .deletion import delete_class, remove_learner
from .selectors import LearnerProgress, progress_of

MOST_AT_ONCE = 500


class ClassSerializer(serializers.Serializer):
    """A class."""

    slug = serializers.CharField(source="group.slug")
    name = serializers.CharField(source="group.name")
    teacher = serializers.CharField(source="group.leader.alias", default=None, allow_null=True)
    plan = serializers.ListField(child=serializers.CharField(), help_text="Slugs of lessons, in order.")
    learners = serializers.SerializerMethodField(help_text="How many learners are in it.")
    made_at = serializers.DateTimeField()

    def get_learners(self, classroom: Classroom) -> int:
        return classroom.size if hasattr(classroom, "size") else classroom.learners.count()


class LearnerSerializer(serializers.Serializer):
    """A learner and their progress, for the teachers of the class."""

    alias = serializers.CharField(source="learner.racer.alias")
    name = serializers.SerializerMethodField(help_text="The real name; empty for a token without the scope organise.")
    student_id = serializers.SerializerMethodField(help_text="For files of marks; empty as the name.")
    lessons = serializers.DictField(
        source="learner.lessons", child=serializers.CharField(), help_text="Opened lessons, and when."
    )
    trainings = serializers.IntegerField(help_text="How many trainings they have started.")
    best_lap_ms = serializers.IntegerField(allow_null=True, help_text="In their latest race of the class.")
    race = serializers.CharField(source="race.slug", default=None, allow_null=True, help_text="That race.")

    def get_name(self, progress: LearnerProgress) -> str:
        return progress.learner.real_name if may_read_secrets(self.context["request"]) else ""

    def get_student_id(self, progress: LearnerProgress) -> str:
        return progress.learner.student_id if may_read_secrets(self.context["request"]) else ""


class CardSerializer(serializers.Serializer):
    """The log-in of a learner. The site keeps only a digest of the code."""

    alias = serializers.CharField(source="learner.racer.alias")
    name = serializers.CharField(source="learner.real_name")
    code = serializers.SerializerMethodField()
    link = serializers.SerializerMethodField(help_text="The log-in page with the code filled in.")

    def get_code(self, card: Card) -> str:
        return services.shown_code(card.code)

    def get_link(self, card: Card) -> str:
        return f"{origin_of(self.context['request']._request)}{reverse('class_code', args=[card.code])}"


class CardsSerializer(serializers.Serializer):
    """Cards of learners."""

    cards = CardSerializer(many=True)


class TeacherSerializer(serializers.Serializer):
    """A further teacher of a class."""

    alias = serializers.CharField(source="racer.alias")
    added_at = serializers.DateTimeField()


def _plan(**options: Any) -> serializers.ListField:
    lessons = serializers.ChoiceField([lesson.slug for lesson in LESSONS])
    return serializers.ListField(child=lessons, max_length=len(LESSONS), help_text="Slugs of lessons.", **options)


class ClassBody(Body):
    """A new class."""

    name = serializers.CharField(max_length=64)
    plan = _plan(required=False)


class ClassPlanBody(Body):
    """What a class works through."""

    plan = _plan()


class LearnersBody(Body):
    """New learners."""

    names = serializers.ListField(
        child=serializers.CharField(max_length=services.MOST_NAME, validators=[visible_line]),
        min_length=1,
        max_length=MOST_AT_ONCE,
        help_text="Real names. Only teachers of the class see them; others see an alias chosen by the site. A student "
        "ID may follow a name after a semicolon.",
    )


class LearnerBody(Body):
    """What a teacher changes of a learner."""

    student_id = serializers.CharField(
        max_length=services.MOST_NAME, allow_blank=True, required=False, help_text='`""` removes it.'
    )


class CodesBody(Body):
    """The learners who get new codes."""

    learners = serializers.ListField(
        child=serializers.CharField(max_length=150),
        required=False,
        min_length=1,
        max_length=MOST_AT_ONCE,
        help_text="Aliases; all learners of the class if not given.",
    )


class TeacherBody(Body):
    """The racer to add as a teacher of the class."""

    alias = serializers.CharField(max_length=150)


def new_teacher(request: Request) -> Racer:
    """The caller. Raises UserFault("class_no_teacher") for learners."""
    teacher = racer_of(request)
    if services.is_learner(teacher):
        raise UserFault("class_no_teacher")
    return teacher


def taught_class(request: Any, slug: str) -> Classroom:
    """Raises Http404 for everybody but teachers of the class."""
    return get_object_or_404(services.classes_taught_by(request.user), group__slug=slug)


def led_class(request: Request, slug: str) -> Classroom:
    """Raises as :func:`taught_class`, and UserFault("class_not_yours") for further teachers."""
    classroom = taught_class(request, slug)
    if not services.can_lead_class(request.user, classroom):
        raise UserFault("class_not_yours")
    return classroom


def taught_learner(request: Request, slug: str, alias: str) -> ClassLearner:
    """A learner of a class that the caller teaches. Raises Http404."""
    learners = taught_class(request, slug).learners.select_related("racer", "classroom__group")
    return get_object_or_404(learners, racer__alias=alias)


def removable_teacher(request: Request, slug: str, alias: str) -> ClassTeacher:
    """A further teacher: the caller, or any for the first teacher. Raises as :func:`led_class`."""
    classroom = (taught_class if alias == racer_of(request).alias else led_class)(request, slug)
    return get_object_or_404(classroom.teachers.select_related("racer", "classroom__group"), racer__alias=alias)


class Organised(PrivateView):
    token_scope = ORGANISE


class ClassesView(Organised):
    @operation("list_classes", "Classes that you teach, the latest first", answer=ClassSerializer, paged=True)
    def get(self, request: Request) -> QuerySet[Classroom]:
        taught = services.classes_taught_by(request.user)
        return taught.select_related("group__leader").annotate(size=Count("learners")).order_by("-made_at", "-pk")

    @operation("create_class", "Create a class", find=new_teacher, body=ClassBody, answer=ClassSerializer, status=201)
    def post(self, request: Request, teacher: Racer, sent: dict[str, Any]) -> Classroom:
        plan = sent.get("plan", [lesson.slug for lesson in LESSONS])
        return services.make_class(teacher=teacher, name=sent["name"], plan=plan, now=timezone.now())


class ClassView(Organised):
    @operation("read_class", "A class", find=taught_class, answer=ClassSerializer)
    def get(self, request: Request, classroom: Classroom) -> Classroom:
        return classroom

    @operation(
        "change_class",
        "Change the lesson plan of a class",
        find=taught_class,
        body=ClassPlanBody,
        partial=True,
        answer=ClassSerializer,
    )
    def patch(self, request: Request, classroom: Classroom, sent: dict[str, list[str]]) -> Classroom:
        services.change_plan(classroom=classroom, by=racer_of(request), plan=sent.get("plan", classroom.plan))
        return classroom

    @operation(
        "delete_class",
        "Delete a class with the accounts of its learners",
        find=led_class,
        description="With their models, runs, trainings, the races and the assignments of the class. Nothing can be "
        "restored. A class with marks is deleted with `?marks_exported=true` only.",
        parameters=[
            OpenApiParameter("marks_exported", bool, description="Whether you have exported the marks."),
        ],
    )
    def delete(self, request: Request, classroom: Classroom) -> None:
        exported = request.query_params.get("marks_exported") == "true"
        delete_class(classroom=classroom, by=racer_of(request), marks_exported=exported)


class Unstored(Organised):
    """Answers with names and codes of learners, which nobody may store; repeated answers too."""

    def finalize_response(self, request: Request, response: Response, *args: Any, **kwargs: Any) -> Response:
        """As REST framework makes it, with ``no-store``, and with the ETag that Django then leaves out."""
        final = super().finalize_response(request, response, *args, **kwargs)
        final["Cache-Control"] = "no-store"
        if request.method == "GET" and final.status_code == 200:
            final.add_post_render_callback(set_response_etag)
        return final


class LearnersView(Unstored):
    @operation("list_learners", "Learners of a class, by name", find=taught_class, answer=LearnerSerializer, paged=True)
    def get(self, request: Request, classroom: Classroom) -> list[LearnerProgress]:
        return progress_of(classroom)

    @operation(
        "add_learners",
        "Create accounts for learners",
        find=taught_class,
        body=LearnersBody,
        answer=CardsSerializer,
        status=201,
        description="All or none. This answer alone has the codes that log in; no cache keeps it.",
    )
    def post(self, request: Request, classroom: Classroom, sent: dict[str, list[str]]) -> dict[str, list[Card]]:
        names = services.names_in("\n".join(sent["names"]))
        cards = services.add_learners(classroom=classroom, by=racer_of(request), names=names, now=timezone.now())
        return {"cards": cards}


class LearnerView(Unstored):
    @operation(
        "change_learner",
        "Change the student ID of a learner",
        find=taught_learner,
        body=LearnerBody,
        partial=True,
        answer=LearnerSerializer,
    )
    def patch(self, request: Request, learner: ClassLearner, sent: dict[str, str]) -> LearnerProgress:
        ids = {learner.pk: sent.get("student_id", learner.student_id)}
        services.set_student_ids(classroom=learner.classroom, by=racer_of(request), ids=ids)
        (progress,) = (one for one in progress_of(learner.classroom) if one.learner == learner)
        return progress

    @operation(
        "remove_learner", "Remove a learner from a class, with the account and all its content", find=taught_learner
    )
    def delete(self, request: Request, learner: ClassLearner) -> None:
        remove_learner(classroom=learner.classroom, by=racer_of(request), racer=learner.racer)


class CodesView(Unstored):
    @operation(
        "renew_codes",
        "Give learners new codes",
        find=taught_class,
        body=CodesBody,
        answer=CardsSerializer,
        description="Old codes stop working and sessions end. This answer alone has the new codes; no cache keeps it.",
    )
    def post(self, request: Request, classroom: Classroom, sent: dict[str, list[str]]) -> dict[str, list[Card]]:
        aliases = sent.get("learners")
        learners = None
        if aliases is not None:
            learners = list(classroom.learners.filter(racer__alias__in=aliases).values_list("racer", flat=True))
            if len(learners) < len(set(aliases)):
                raise UserFault("class_learner_unknown")
        return {"cards": services.new_codes(classroom=classroom, by=racer_of(request), learners=learners)}


class TeachersView(Organised):
    @operation("list_teachers", "Further teachers of a class", find=taught_class, answer=TeacherSerializer, paged=True)
    def get(self, request: Request, classroom: Classroom) -> QuerySet[ClassTeacher]:
        return classroom.teachers.select_related("racer")

    @operation(
        "add_teacher",
        "Let another racer teach the class",
        find=led_class,
        body=TeacherBody,
        answer=TeacherSerializer,
        status=201,
        description="A repeated request changes nothing.",
    )
    def post(self, request: Request, classroom: Classroom, sent: dict[str, str]) -> ClassTeacher:
        return services.add_teacher(classroom=classroom, by=racer_of(request), now=timezone.now(), **sent)


class TeacherView(Organised):
    @operation(
        "remove_teacher", "Remove a further teacher; further teachers may remove themselves", find=removable_teacher
    )
    def delete(self, request: Request, teacher: ClassTeacher) -> None:
        services.remove_teacher(classroom=teacher.classroom, by=racer_of(request), racer=teacher.racer)

"""Classes of a teacher: list, create, change, delete; learners, their cards, further teachers."""

from typing import Any

from django.db.models import Count, QuerySet
from django.shortcuts import get_object_or_404
from django.urls import reverse
from django.utils import timezone
from django.utils.cache import set_response_etag
from drf_spectacular.utils import OpenApiParameter, extend_schema, extend_schema_view
from rest_framework import serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.class_accounts import services
from accounts.models import ClassLearner, Classroom, ClassTeacher
from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from accounts.tokens.services import may_read_secrets
from core.addresses import origin_of
from core.api.bodies import Body, read_as
from core.api.finding import finds
from core.api.views import APIView, ListAPIView
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

    def get_code(self, card: services.Card) -> str:
        return services.shown_code(card.code)

    def get_link(self, card: services.Card) -> str:
        return f"{self.context['origin']}{reverse('class_code', args=[card.code])}"


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


class Organised(APIView):
    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]


@extend_schema_view(get=extend_schema(operation_id="list_classes", summary="Classes that you teach, the latest first"))
class ClassesView(Organised, ListAPIView):
    serializer_class = ClassSerializer

    def get_queryset(self) -> QuerySet[Classroom]:
        taught = services.classes_taught_by(self.request.user)
        return taught.select_related("group__leader").annotate(size=Count("learners")).order_by("-made_at", "-pk")

    @extend_schema(
        operation_id="create_class",
        summary="Create a class",
        request=ClassBody,
        responses={201: ClassSerializer},
    )
    def post(self, request: Request) -> Response:
        teacher = racer_of(request)
        if services.is_learner(teacher):
            raise UserFault("class_no_teacher")
        sent = {"plan": [lesson.slug for lesson in LESSONS], **read_as(ClassBody, request.data)}
        made = services.make_class(teacher=teacher, now=timezone.now(), **sent)
        return Response(ClassSerializer(made).data, status=status.HTTP_201_CREATED)


class ClassView(Organised):
    @extend_schema(operation_id="read_class", summary="A class", responses=ClassSerializer)
    def get(self, request: Request, slug: str) -> Response:
        return Response(ClassSerializer(taught_class(request, slug)).data)

    @extend_schema(
        operation_id="change_class",
        summary="Change the lesson plan of a class",
        request=ClassPlanBody,
        responses=ClassSerializer,
    )
    @finds(taught_class)
    def patch(self, request: Request, classroom: Classroom) -> Response:
        wanted = read_as(ClassPlanBody, request.data, partial=True).get("plan", classroom.plan)
        services.change_plan(classroom=classroom, by=racer_of(request), plan=wanted)
        return Response(ClassSerializer(classroom).data)

    @extend_schema(
        operation_id="delete_class",
        summary="Delete a class with the accounts of its learners",
        description="With their models, runs, trainings, the races and the assignments of the class. Nothing can be "
        "restored. A class with marks is deleted with `?marks_exported=true` only.",
        parameters=[
            OpenApiParameter("marks_exported", bool, description="Whether you have exported the marks."),
        ],
    )
    @finds(led_class, fields=False)
    def delete(self, request: Request, classroom: Classroom) -> Response:
        exported = request.query_params.get("marks_exported") == "true"
        delete_class(classroom=classroom, by=racer_of(request), marks_exported=exported)
        return Response(status=status.HTTP_204_NO_CONTENT)


class Unstored(Organised):
    """Answers with names and codes of learners, which nobody may store; repeated answers too."""

    def finalize_response(self, request: Request, response: Response, *args: Any, **kwargs: Any) -> Response:
        """As REST framework makes it, with ``no-store``, and with the ETag that Django then leaves out."""
        final = super().finalize_response(request, response, *args, **kwargs)
        final["Cache-Control"] = "no-store"
        if request.method == "GET" and final.status_code == 200:
            final.add_post_render_callback(set_response_etag)
        return final


@extend_schema_view(get=extend_schema(operation_id="list_learners", summary="Learners of a class, by name"))
class LearnersView(Unstored, ListAPIView):
    serializer_class = LearnerSerializer

    def get_queryset(self) -> list[LearnerProgress]:  # type: ignore[override]  # its pages are cut from a list
        return progress_of(taught_class(self.request, self.kwargs["slug"]))

    @extend_schema(
        operation_id="add_learners",
        summary="Create accounts for learners",
        description="All or none. This answer alone has the codes that log in; no cache keeps it.",
        request=LearnersBody,
        responses={201: CardsSerializer},
    )
    @finds(taught_class)
    def post(self, request: Request, classroom: Classroom) -> Response:
        names = services.names_in("\n".join(read_as(LearnersBody, request.data)["names"]))
        cards = services.add_learners(classroom=classroom, by=racer_of(request), names=names, now=timezone.now())
        return _cards(request, cards, status.HTTP_201_CREATED)


class LearnerView(Unstored):
    @extend_schema(
        operation_id="change_learner",
        summary="Change the student ID of a learner",
        request=LearnerBody,
        responses=LearnerSerializer,
    )
    @finds(taught_learner)
    def patch(self, request: Request, learner: ClassLearner) -> Response:
        wanted = read_as(LearnerBody, request.data, partial=True).get("student_id", learner.student_id)
        ids = {learner.pk: wanted}
        services.set_student_ids(classroom=learner.classroom, by=racer_of(request), ids=ids)
        (progress,) = (one for one in progress_of(learner.classroom) if one.learner == learner)
        return Response(LearnerSerializer(progress, context={"request": request}).data)

    @extend_schema(
        operation_id="remove_learner", summary="Remove a learner from a class, with the account and all its content"
    )
    @finds(taught_learner, fields=False)
    def delete(self, request: Request, learner: ClassLearner) -> Response:
        remove_learner(classroom=learner.classroom, by=racer_of(request), racer=learner.racer)
        return Response(status=status.HTTP_204_NO_CONTENT)


class CodesView(Unstored):
    @extend_schema(
        operation_id="renew_codes",
        summary="Give learners new codes",
        description="Old codes stop working and sessions end. This answer alone has the new codes; no cache keeps it.",
        request=CodesBody,
        responses=CardsSerializer,
    )
    @finds(taught_class)
    def post(self, request: Request, classroom: Classroom) -> Response:
        aliases = read_as(CodesBody, request.data).get("learners")
        learners = None
        if aliases is not None:
            learners = list(classroom.learners.filter(racer__alias__in=aliases).values_list("racer", flat=True))
            if len(learners) < len(set(aliases)):
                raise UserFault("class_learner_unknown")
        return _cards(request, services.new_codes(classroom=classroom, by=racer_of(request), learners=learners))


@extend_schema_view(get=extend_schema(operation_id="list_teachers", summary="Further teachers of a class"))
class TeachersView(Organised, ListAPIView):
    serializer_class = TeacherSerializer

    def get_queryset(self) -> QuerySet[ClassTeacher]:
        return taught_class(self.request, self.kwargs["slug"]).teachers.select_related("racer")

    @extend_schema(
        operation_id="add_teacher",
        summary="Let another racer teach the class",
        description="A repeated request changes nothing.",
        request=TeacherBody,
        responses={201: TeacherSerializer},
    )
    @finds(led_class)
    def post(self, request: Request, classroom: Classroom) -> Response:
        alias = read_as(TeacherBody, request.data)["alias"]
        teacher = services.add_teacher(classroom=classroom, by=racer_of(request), alias=alias, now=timezone.now())
        return Response(TeacherSerializer(teacher).data, status=status.HTTP_201_CREATED)


class TeacherView(Organised):
    @extend_schema(
        operation_id="remove_teacher", summary="Remove a further teacher; further teachers may remove themselves"
    )
    @finds(removable_teacher, fields=False)
    def delete(self, request: Request, teacher: ClassTeacher) -> Response:
        services.remove_teacher(classroom=teacher.classroom, by=racer_of(request), racer=teacher.racer)
        return Response(status=status.HTTP_204_NO_CONTENT)


def _cards(request: Request, cards: list[services.Card], code: int = status.HTTP_200_OK) -> Response:
    data = CardsSerializer({"cards": cards}, context={"origin": origin_of(request._request)}).data
    return Response(data, status=code)

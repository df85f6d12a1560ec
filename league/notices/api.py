"""API operations on a racer's notices and notice settings."""

from django.conf import settings
from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, extend_schema, extend_schema_view
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body, read_as, refuse_fields
from core.api.fields import ChoiceField, ComputedField
from core.api.finding import finds
from core.api.views import APIView, ListAPIView
from league.models import Notice, NoticeChoice
from league.notices.kinds import choices
from league.notices.selectors import notices_of
from league.notices.sentences import sentence
from league.notices.services import choice_of, choose_notices, mark_read


class NoticeSerializer(serializers.Serializer):
    """A notice."""

    id = serializers.IntegerField(source="pk")
    kind = ChoiceField(choices)
    text = ComputedField(serializers.CharField(), sentence, help_text="In the language of the request.")
    params = serializers.DictField(help_text="The values in the text.")
    path = serializers.CharField(allow_blank=True, help_text="Of the page that it leads to.")
    at = serializers.DateTimeField()
    read_at = serializers.DateTimeField(allow_null=True)


class NoticeFilter(serializers.Serializer):
    """What the list may be asked for."""

    unread = serializers.BooleanField(required=False, allow_null=True, default=None)


class ReadSerializer(serializers.Serializer):
    """How many notices were unread."""

    marked = serializers.IntegerField()


class ChoiceSerializer(serializers.Serializer):
    """Notice settings of a racer."""

    site_off = serializers.ListField(child=ChoiceField(choices), help_text="Not in the site.")
    mail_off = serializers.ListField(child=ChoiceField(choices), help_text="Not by e-mail.")
    language = serializers.ChoiceField(settings.LANGUAGES, help_text="Of e-mails and of messages to chats.")


class ChoiceBody(Body):
    """What is to change; what is left out stays."""

    site_off = serializers.ListField(
        child=ChoiceField(choices), required=False, max_length=100, help_text="Not in the site."
    )
    mail_off = serializers.ListField(
        child=ChoiceField(choices), required=False, max_length=100, help_text="Not by e-mail."
    )
    language = serializers.ChoiceField(settings.LANGUAGES, required=False)


@extend_schema_view(
    get=extend_schema(
        operation_id="list_notices",
        summary="My notices, the latest first",
        parameters=[OpenApiParameter("unread", OpenApiTypes.BOOL, description="Only those not read yet, or read.")],
    )
)
class NoticesView(ListAPIView):
    permission_classes = [IsAuthenticated]
    serializer_class = NoticeSerializer

    def get_queryset(self) -> QuerySet[Notice]:
        asked = read_as(NoticeFilter, self.request.query_params)
        notices = notices_of(self.request.user)
        unread = asked["unread"]
        return notices if unread is None else notices.filter(read_at__isnull=unread)


class NoticesReadView(APIView):
    token_scope = RACE

    @extend_schema(
        operation_id="mark_notices_read",
        summary="Mark all of my notices as read",
        request=None,
        responses=ReadSerializer,
    )
    def post(self, request: Request) -> Response:
        refuse_fields(request)
        return Response(ReadSerializer({"marked": mark_read(racer=racer_of(request), now=timezone.now())}).data)


def own_notice(request: Request, number: int) -> Notice:
    return get_object_or_404(notices_of(request.user), pk=number)


class NoticeReadView(APIView):
    token_scope = RACE

    @extend_schema(
        operation_id="mark_notice_read",
        summary="Mark one of my notices as read",
        description="One that was read stays as it is.",
        responses=NoticeSerializer,
    )
    @finds(own_notice, fields=False)
    def post(self, request: Request, notice: Notice) -> Response:
        mark_read(racer=racer_of(request), now=timezone.now(), notice=notice.pk)
        notice.refresh_from_db()
        return Response(NoticeSerializer(notice).data)


class NoticeSettingsView(APIView):
    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="read_notice_settings",
        summary="Your notice settings",
        responses=ChoiceSerializer,
    )
    def get(self, request: Request) -> Response:
        return Response(ChoiceSerializer(choice_of(racer_of(request))).data)

    @extend_schema(
        operation_id="choose_notices",
        summary="Change your notice settings",
        request=ChoiceBody,
        responses=ChoiceSerializer,
    )
    def patch(self, request: Request) -> Response:
        sent = read_as(ChoiceBody, request.data)
        before: NoticeChoice = choice_of(racer_of(request))
        kept = {name: getattr(before, name) for name in ("site_off", "mail_off", "language")}
        chosen = choose_notices(racer=racer_of(request), **(kept | sent))
        return Response(ChoiceSerializer(chosen).data)

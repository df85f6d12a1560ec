"""API operations on a racer's notices and notice settings."""

from django.conf import settings
from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body
from core.api.fields import ChoiceField, ComputedField
from core.api.operations import operation
from core.api.views import APIView, PrivateView
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

    unread = serializers.BooleanField(
        required=False, allow_null=True, default=None, help_text="Only those not read yet, or read."
    )


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


class NoticesView(PrivateView):
    @operation("list_notices", "My notices, the latest first", query=NoticeFilter, answer=NoticeSerializer, paged=True)
    def get(self, request: Request, asked: dict[str, bool | None]) -> QuerySet[Notice]:
        notices = notices_of(request.user)
        unread = asked["unread"]
        return notices if unread is None else notices.filter(read_at__isnull=unread)


class NoticesReadView(APIView):
    token_scope = RACE

    @operation("mark_notices_read", "Mark all of my notices as read", answer=ReadSerializer)
    def post(self, request: Request) -> dict[str, int]:
        return {"marked": mark_read(racer=racer_of(request), now=timezone.now())}


def own_notice(request: Request, number: int) -> Notice:
    return get_object_or_404(notices_of(request.user), pk=number)


class NoticeReadView(APIView):
    token_scope = RACE

    @operation(
        "mark_notice_read",
        "Mark one of my notices as read",
        find=own_notice,
        answer=NoticeSerializer,
        description="One that was read stays as it is.",
    )
    def post(self, request: Request, notice: Notice) -> Notice:
        mark_read(racer=racer_of(request), now=timezone.now(), notice=notice.pk)
        notice.refresh_from_db()
        return notice


class NoticeSettingsView(PrivateView):
    token_scope = RACE

    @operation("read_notice_settings", "Your notice settings", answer=ChoiceSerializer)
    def get(self, request: Request) -> NoticeChoice:
        return choice_of(racer_of(request))

    @operation("choose_notices", "Change your notice settings", body=ChoiceBody, answer=ChoiceSerializer)
    def patch(self, request: Request, sent: dict[str, object]) -> NoticeChoice:
        before = choice_of(racer_of(request))
        kept = {name: getattr(before, name) for name in ("site_off", "mail_off", "language")}
        return choose_notices(racer=racer_of(request), **(kept | sent))

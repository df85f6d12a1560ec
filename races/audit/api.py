"""The audit log in the API."""

from typing import Any

from django.core.exceptions import PermissionDenied
from django.db.models import QuerySet
from django.http import Http404, HttpResponseBase
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticated
from rest_framework.renderers import BaseRenderer, JSONRenderer
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.utils.urls import replace_query_param

from core.api.bodies import read_as
from core.api.documents import serializer_of
from core.api.views import APIView, FileRenderer, FileView
from core.audit.models import AuditEntry

from ..web.api import organised_race
from .exports import FORMS, AuditDocument, entry_data
from .selectors import PER_PAGE, AuditFilter, entries_visible_to, page_of, reads_all
from .views import exported

MAX_PER_PAGE = 100
AuditEntrySerializer = serializer_of(AuditDocument, "AuditEntry")


class AuditListSerializer(serializers.Serializer):
    """Entries, the newest first."""

    next = serializers.CharField(allow_null=True, help_text="The address of older entries.")
    results = AuditEntrySerializer(many=True)


class AuditFilterSerializer(serializers.Serializer):
    """Which entries."""

    actor = serializers.CharField(default="", max_length=64, help_text="An alias, or # and an id.")
    action = serializers.CharField(default="", max_length=48)
    target = serializers.CharField(default="", max_length=130, help_text="A name, or kind:id.")
    since = serializers.DateField(default=None, help_text="The first day.")
    until = serializers.DateField(default=None, help_text="The last day.")


class AuditPageSerializer(AuditFilterSerializer):
    """Which entries, and how many."""

    before = serializers.IntegerField(default=None, min_value=1, max_value=2**63 - 1, help_text="Older than this id.")
    page_size = serializers.IntegerField(min_value=1, max_value=MAX_PER_PAGE, default=PER_PAGE)


def _listed(request: Request, entries: QuerySet[AuditEntry]) -> Response:
    asked: dict[str, Any] = dict(read_as(AuditPageSerializer, request.query_params))
    before, size = asked.pop("before"), asked.pop("page_size")
    page = page_of(AuditFilter(**asked)(entries), before=before, size=size)
    in_full = reads_all(request.user)
    address = request.build_absolute_uri()
    following = None if page.older is None else replace_query_param(address, "before", page.older)
    return Response({"next": following, "results": [entry_data(entry, in_full=in_full) for entry in page.entries]})


class AuditView(APIView):
    tag = "audit"
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="list_audit_log",
        summary="The audit log, for admins",
        parameters=[AuditPageSerializer],
        responses=AuditListSerializer,
    )
    def get(self, request: Request) -> Response:
        if not reads_all(request.user):
            raise PermissionDenied
        return _listed(request, entries_visible_to(request.user))


class RaceAuditView(APIView):
    tag = "audit"
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="list_race_audit_log",
        summary="What was done about a race, for its organisers",
        parameters=[AuditPageSerializer],
        responses=AuditListSerializer,
    )
    def get(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        return _listed(request, entries_visible_to(request.user).filter(race=race.pk))


class AuditExportView(FileView):
    tag = "audit"
    permission_classes = [IsAuthenticated]

    def get_renderers(self) -> list[BaseRenderer]:
        kinds = (kind.partition(";")[0] for kind, _lines in FORMS.values())
        return [JSONRenderer(), *(FileRenderer(kind) for kind in kinds)]

    @extend_schema(
        operation_id="export_audit_log",
        summary="The audit log as a file, for admins",
        description="The oldest entry first, as CSV or JSON Lines.",
        parameters=[OpenApiParameter("form", str, OpenApiParameter.PATH, enum=[*FORMS]), AuditFilterSerializer],
        responses={(200, kind.partition(";")[0]): OpenApiTypes.STR for kind, _lines in FORMS.values()},
    )
    def get(self, request: Request, form: str) -> HttpResponseBase:
        if not reads_all(request.user):
            raise PermissionDenied
        if form not in FORMS:
            raise Http404
        return exported(request.user, AuditFilter(**read_as(AuditFilterSerializer, request.query_params)), form)

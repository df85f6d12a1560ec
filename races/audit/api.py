"""The audit log in the API."""

from datetime import date
from typing import Any, TypedDict

from django.core.exceptions import PermissionDenied
from django.db.models import QuerySet
from django.http import Http404, HttpResponseBase
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter
from rest_framework import serializers
from rest_framework.renderers import BaseRenderer, JSONRenderer
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.utils.urls import replace_query_param

from core.api.documents import serializer_of
from core.api.operations import operation
from core.api.views import FileRenderer, FileView, PrivateView
from core.audit.models import AuditEntry

from ..models import Race
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


class AuditQuery(TypedDict):
    """What :class:`AuditFilterSerializer` reads."""

    actor: str
    action: str
    target: str
    since: date | None
    until: date | None


class AuditPageQuery(AuditQuery):
    before: int | None
    page_size: int


def _for_admins(request: Request, form: str = "") -> str:
    """The form of an export, if one is asked for. Raises PermissionDenied, Http404."""
    if not reads_all(request.user):
        raise PermissionDenied
    if form and form not in FORMS:
        raise Http404
    return form


def _listed(
    request: Request, entries: QuerySet[AuditEntry], *, before: int | None, page_size: int, **asked: Any
) -> Response:
    page = page_of(AuditFilter(**asked)(entries), before=before, size=page_size)
    in_full = reads_all(request.user)
    address = request.build_absolute_uri()
    following = None if page.older is None else replace_query_param(address, "before", page.older)
    return Response({"next": following, "results": [entry_data(entry, in_full=in_full) for entry in page.entries]})


class AuditView(PrivateView):
    @operation(
        "list_audit_log",
        "The audit log, for admins",
        find=_for_admins,
        query=AuditPageSerializer,
        answer=AuditListSerializer,
    )
    def get(self, request: Request, _none: None, asked: AuditPageQuery) -> Response:
        return _listed(request, entries_visible_to(request.user), **asked)


class RaceAuditView(PrivateView):
    tag = "audit"

    @operation(
        "list_race_audit_log",
        "What was done about a race, for its organisers",
        find=organised_race,
        query=AuditPageSerializer,
        answer=AuditListSerializer,
    )
    def get(self, request: Request, race: Race, asked: AuditPageQuery) -> Response:
        return _listed(request, entries_visible_to(request.user).filter(race=race.pk), **asked)


class AuditExportView(PrivateView, FileView):
    def get_renderers(self) -> list[BaseRenderer]:
        kinds = (kind.partition(";")[0] for kind, _lines in FORMS.values())
        return [JSONRenderer(), *(FileRenderer(kind) for kind in kinds)]

    @operation(
        "export_audit_log",
        "The audit log as a file, for admins",
        find=_for_admins,
        query=AuditFilterSerializer,
        answer={(200, kind.partition(";")[0]): OpenApiTypes.STR for kind, _lines in FORMS.values()},
        description="The oldest entry first, as CSV or JSON Lines.",
        parameters=[OpenApiParameter("form", str, OpenApiParameter.PATH, enum=[*FORMS])],
    )
    def get(self, request: Request, form: str, asked: AuditQuery) -> HttpResponseBase:
        return exported(request.user, AuditFilter(**asked), form)

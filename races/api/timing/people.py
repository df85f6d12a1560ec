"""Timekeepers."""

from __future__ import annotations

from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiResponse, extend_schema
from rest_framework import serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import ORGANISE
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields

from ...selectors.timing import timekeepers_of
from ...services import timing
from ..lookup import organised_race


class TimekeeperSerializer(serializers.Serializer):
    """Who may take times besides the organiser."""

    racer = serializers.CharField(source="racer.alias")
    named_at = serializers.DateTimeField()


class NameTimekeeperSerializer(Body):
    """Whom to name."""

    racer = serializers.CharField(max_length=64)


class TimekeepersView(APIView):
    """Who may take times."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="list_timekeepers",
        summary="Timekeepers of a race that you organise",
        responses=TimekeeperSerializer(many=True),
        tags=["timing"],
    )
    def get(self, request: Request, slug: str) -> Response:
        return Response(TimekeeperSerializer(timekeepers_of(organised_race(request, slug)), many=True).data)

    @extend_schema(
        operation_id="name_timekeeper",
        summary="Name a timekeeper",
        request=NameTimekeeperSerializer,
        responses=TimekeeperSerializer,
        tags=["timing"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        alias = read_as(NameTimekeeperSerializer, request.data)["racer"]
        named = timing.name_timekeeper(race=race, alias=alias, by=racer_of(request), now=timezone.now())
        return Response(TimekeeperSerializer(named).data)


class TimekeeperView(APIView):
    """One timekeeper."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="dismiss_timekeeper",
        summary="Dismiss a timekeeper",
        request=None,
        responses={204: OpenApiResponse(description="Dismissed; what they timed stays.")},
        tags=["timing"],
    )
    def delete(self, request: Request, slug: str, alias: str) -> Response:
        refuse_fields(request)
        race = organised_race(request, slug)
        named = get_object_or_404(timekeepers_of(race), racer__alias__iexact=alias)
        timing.dismiss_timekeeper(race=race, racer=named.racer, by=racer_of(request))
        return Response(status=status.HTTP_204_NO_CONTENT)

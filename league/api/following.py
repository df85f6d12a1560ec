"""Racers whom I follow."""

from __future__ import annotations

from django.db.models import QuerySet
from django.http import Http404
from django.utils import timezone
from drf_spectacular.utils import extend_schema, extend_schema_view
from rest_framework import generics, serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.following import follow_racer, followed_by, unfollow_racer
from accounts.models import Follow, Racer
from accounts.scopes import RACE
from accounts.who import racer_of
from core.bodies import refuse_fields
from league.selectors.racers import racer_shown


class FollowSerializer(serializers.Serializer):
    """A racer whom I follow."""

    racer = serializers.CharField(source="followed.alias")
    since = serializers.DateTimeField()


@extend_schema_view(
    get=extend_schema(
        operation_id="list_following",
        summary="Racers I follow, the latest first",
        responses=FollowSerializer,
        tags=["following"],
    )
)
class FollowingView(generics.ListAPIView):
    """Whom I follow."""

    permission_classes = [IsAuthenticated]
    serializer_class = FollowSerializer

    def get_queryset(self) -> QuerySet[Follow]:
        return followed_by(racer_of(self.request))


class FollowView(APIView):
    """One of them."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="follow_racer",
        summary="Follow a racer",
        description="Whom I follow already I follow still.",
        request=None,
        responses=FollowSerializer,
        tags=["following"],
    )
    def put(self, request: Request, alias: str) -> Response:
        refuse_fields(request)
        follow = follow_racer(follower=racer_of(request), racer=self._racer(alias), now=timezone.now())
        return Response(FollowSerializer(follow).data)

    @extend_schema(
        operation_id="unfollow_racer",
        summary="Follow a racer no more",
        request=None,
        responses={204: None},
        tags=["following"],
    )
    def delete(self, request: Request, alias: str) -> Response:
        refuse_fields(request)
        unfollow_racer(follower=racer_of(request), racer=self._racer(alias))
        return Response(status=status.HTTP_204_NO_CONTENT)

    def _racer(self, alias: str) -> Racer:
        racer = racer_shown(alias)
        if racer is None:
            raise Http404
        return racer

"""API operations on followed racers."""

from django.db.models import QuerySet
from django.utils import timezone
from drf_spectacular.utils import extend_schema, extend_schema_view
from rest_framework import serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.following import follow_racer, followed_by, unfollow_racer
from accounts.models import Follow, Racer
from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.finding import finds
from core.api.views import APIView, ListAPIView
from league.racers.api import shown_racer


class FollowSerializer(serializers.Serializer):
    """A racer whom I follow."""

    racer = serializers.CharField(source="followed.alias")
    since = serializers.DateTimeField()


@extend_schema_view(get=extend_schema(operation_id="list_following", summary="Racers I follow, the latest first"))
class FollowingView(ListAPIView):
    permission_classes = [IsAuthenticated]
    serializer_class = FollowSerializer

    def get_queryset(self) -> QuerySet[Follow]:
        return followed_by(racer_of(self.request))


class FollowView(APIView):
    token_scope = RACE

    @extend_schema(
        operation_id="follow_racer",
        summary="Follow a racer",
        description="Whom I follow already I follow still.",
        responses=FollowSerializer,
    )
    @finds(shown_racer, fields=False)
    def put(self, request: Request, racer: Racer) -> Response:
        follow = follow_racer(follower=racer_of(request), racer=racer, now=timezone.now())
        return Response(FollowSerializer(follow).data)

    @extend_schema(operation_id="unfollow_racer", summary="Follow a racer no more")
    @finds(shown_racer, fields=False)
    def delete(self, request: Request, racer: Racer) -> Response:
        unfollow_racer(follower=racer_of(request), racer=racer)
        return Response(status=status.HTTP_204_NO_CONTENT)

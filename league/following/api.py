"""API operations on followed racers."""

from django.db.models import QuerySet
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.following import follow_racer, followed_by, unfollow_racer
from accounts.models import Follow, Racer
from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from league.racers.api import shown_racer


class FollowSerializer(serializers.Serializer):
    """A racer whom I follow."""

    racer = serializers.CharField(source="followed.alias")
    since = serializers.DateTimeField()


class FollowingView(PrivateView):
    @operation("list_following", "Racers I follow, the latest first", answer=FollowSerializer, paged=True)
    def get(self, request: Request) -> QuerySet[Follow]:
        return followed_by(racer_of(request))


class FollowView(APIView):
    token_scope = RACE

    @operation(
        "follow_racer",
        "Follow a racer",
        find=shown_racer,
        answer=FollowSerializer,
        description="Whom I follow already I follow still.",
    )
    def put(self, request: Request, racer: Racer) -> Follow:
        return follow_racer(follower=racer_of(request), racer=racer, now=timezone.now())

    @operation("unfollow_racer", "Follow a racer no more", find=shown_racer)
    def delete(self, request: Request, racer: Racer) -> None:
        unfollow_racer(follower=racer_of(request), racer=racer)

"""Races: find, read, make, change and cancel them."""

from __future__ import annotations

from django.contrib.admin.models import ADDITION
from django.db.models import Q, QuerySet
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, extend_schema, extend_schema_field, extend_schema_view
from rest_framework import generics, serializers, status
from rest_framework.permissions import IsAuthenticated, IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.models import Racer, RacerGroup
from accounts.scopes import ORGANISE
from accounts.who import racer_of
from core.api.fields import ZonedDateTimeField
from core.bodies import Body, read_as, refuse_fields
from paddock.errors import UserFault
from paddock.rules.race import RULES
from tracks.api import TrackField

from .. import services
from ..audit import log
from ..layout import box_rows
from ..models import Division, Entry, Race, RaceKind, RaceState, RaceType, TeamEntries, Visibility
from ..models.race import MINIMUM_LAP_MS, MOST_TERMS, SESSION_S
from ..ranking import order_rule, rule_for
from ..rules.serializers import with_rules
from ..selectors import can_organise, can_see_race, races_visible_to
from ..services.races import edition_of
from ..spectators import spectator_token
from .lookup import organised_race, visible_race
from .placed import PlacedBoxSerializer


class TrackSummarySerializer(serializers.Serializer):
    """Which track."""

    slug = serializers.CharField()
    name = serializers.CharField()
    length_m = serializers.FloatField()


class RaceSerializer(with_rules(serializers.Serializer, RULES)):  # type: ignore[misc]
    """A race and its rules."""

    slug = serializers.CharField()
    kind = serializers.ChoiceField(RaceKind.choices)
    division = serializers.ChoiceField(Division.choices, allow_blank=True, help_text="Of a league race.")
    name = serializers.CharField()
    description = serializers.CharField(allow_blank=True)
    prize = serializers.CharField(allow_blank=True)
    sponsor = serializers.CharField(allow_blank=True)
    terms_version = serializers.IntegerField(help_text="Of the terms that whoever joins accepts; 0: none.")
    organiser = serializers.CharField(source="organiser.alias", default=None, allow_null=True)
    state = serializers.SerializerMethodField()
    opens_at = serializers.DateTimeField()
    closes_at = serializers.DateTimeField()
    cancelled_at = serializers.DateTimeField(allow_null=True)
    cancel_reason = serializers.CharField(allow_blank=True)
    track = TrackSummarySerializer()
    visibility = serializers.ChoiceField(Visibility.choices)
    team_entries = serializers.ChoiceField(
        TeamEntries.choices, help_text="Whether it is for teams, and with how many cars each."
    )
    group = serializers.CharField(
        source="group.slug", default=None, allow_null=True, help_text="Whose members alone may enter; null: everybody."
    )
    physical = serializers.BooleanField(help_text="Real cars, timed at the track; nothing is simulated.")
    session_s = serializers.IntegerField(help_text="Of real cars: seconds that a racer has on the track.")
    minimum_lap_ms = serializers.IntegerField(help_text="Of real cars: two crossings closer together are one.")
    beside = serializers.SerializerMethodField(help_text="The simulated race beside it, where you may see it.")
    engine = serializers.CharField(
        allow_blank=True, help_text="The simulator that its counted results are of; empty before the first."
    )
    next_engine = serializers.CharField(
        allow_blank=True, help_text="The one that all its counted runs are being driven again with; else empty."
    )

    @extend_schema_field({"type": "string", "nullable": True})
    def get_beside(self, race: Race) -> str | None:
        other = race.beside
        return None if other is None or not can_see_race(self.context["request"].user, other) else other.slug

    def get_state(self, race: Race) -> RaceState:
        return race.state_at(timezone.now())


class RaceDetailSerializer(RaceSerializer):
    """A race with what its rules mean, and for who organises it the invitation."""

    terms = serializers.CharField(allow_blank=True, help_text="What whoever joins accepts.")
    placed_boxes = serializers.SerializerMethodField(
        help_text="Every box where it stands, drawn ones too, in the order driven."
    )
    ranking_rule = serializers.SerializerMethodField(help_text="In plain sentences, in the reader's language.")
    tie_rule = serializers.SerializerMethodField()
    edition = serializers.SerializerMethodField(help_text="Another after every change; see the change of a race.")
    invitation = serializers.SerializerMethodField(help_text="The secret that joins; only for who organises the race.")
    spectators = serializers.SerializerMethodField(
        help_text="The token of the spectators' link, /watch/TOKEN/; only for the organiser of a race by invitation."
    )

    @extend_schema_field(PlacedBoxSerializer(many=True))
    def get_placed_boxes(self, race: Race) -> list[dict]:
        return box_rows(race)

    def get_ranking_rule(self, race: Race) -> str:
        return rule_for(race).rule(race)

    def get_tie_rule(self, race: Race) -> str:
        return order_rule(race)

    def get_edition(self, race: Race) -> str:
        return edition_of(race)

    def get_invitation(self, race: Race) -> str | None:
        hidden = race.visibility != Visibility.INVITATION or not can_organise(self.context["request"].user, race)
        return None if hidden else race.invitation

    def get_spectators(self, race: Race) -> str | None:
        hidden = race.visibility != Visibility.INVITATION or not can_organise(self.context["request"].user, race)
        return None if hidden else spectator_token(race)


class RaceChangeSerializer(with_rules(Body, RULES, asked=True)):  # type: ignore[misc]
    """What may be changed of a race. Bounds that one field cannot know are checked with the whole race."""

    name = serializers.CharField(max_length=64, required=False)
    description = serializers.CharField(max_length=2000, allow_blank=True, required=False)
    prize = serializers.CharField(max_length=200, allow_blank=True, required=False)
    sponsor = serializers.CharField(max_length=64, allow_blank=True, required=False)
    terms = serializers.CharField(
        max_length=MOST_TERMS,
        allow_blank=True,
        required=False,
        help_text="Whoever joins accepts them first; a change asks everybody anew.",
    )
    track = TrackField(required=False)
    physical = serializers.BooleanField(required=False, help_text="Real cars, timed at the track.")
    session_s = serializers.IntegerField(required=False, min_value=SESSION_S[0], max_value=SESSION_S[1])
    minimum_lap_ms = serializers.IntegerField(required=False, min_value=MINIMUM_LAP_MS[0], max_value=MINIMUM_LAP_MS[1])
    beside = serializers.SlugRelatedField(
        slug_field="slug",
        queryset=Race.objects.filter(visibility=Visibility.PUBLIC),
        required=False,
        allow_null=True,
        help_text="The slug of a public, simulated race on the same track.",
    )
    opens_at = ZonedDateTimeField(required=False)
    closes_at = ZonedDateTimeField(required=False)
    visibility = serializers.ChoiceField(Visibility.choices, required=False)
    team_entries = serializers.ChoiceField(TeamEntries.choices, required=False, allow_blank=True)
    group = serializers.SlugRelatedField(
        slug_field="slug",
        queryset=RacerGroup.objects.all(),
        required=False,
        allow_null=True,
        help_text="Whose members alone may enter: a listed group's, or one that you lead; null: everybody.",
    )


class RaceEditSerializer(RaceChangeSerializer):
    """A change, and of which state of the race."""

    edition = serializers.CharField(
        max_length=64,
        required=False,
        help_text="As the race was read: the change is refused if somebody else has changed it since.",
    )


class NewRaceSerializer(RaceChangeSerializer):
    """A race. What is left out has the default that a read race shows."""

    name = serializers.CharField(max_length=64)
    track = TrackField()
    opens_at = ZonedDateTimeField()
    closes_at = ZonedDateTimeField()
    division = serializers.ChoiceField(
        Division.choices, required=False, help_text="Makes it a race of the league; admins only."
    )


class FilterSerializer(serializers.Serializer):
    """Which races to list."""

    state = serializers.ChoiceField(RaceState.choices, required=False)
    kind = serializers.ChoiceField(RaceKind.choices, required=False)
    race_type = serializers.ChoiceField(RaceType.choices, required=False)
    mine = serializers.BooleanField(required=False, default=False)


class CancelSerializer(Body):
    """Why."""

    reason = serializers.CharField(allow_blank=True, max_length=255, help_text="Everybody who entered reads it.")


@extend_schema_view(
    get=extend_schema(
        operation_id="list_races",
        summary="Races",
        description="Public ones, and those by invitation that you are in or organise; the latest first.",
        parameters=[
            OpenApiParameter("state", enum=RaceState.values, description="As things stand now."),
            OpenApiParameter("kind", enum=RaceKind.values, description="Who holds it."),
            OpenApiParameter("race_type", enum=RaceType.values),
            OpenApiParameter("mine", bool, description="Only those that you are in or organise."),
        ],
        responses=RaceSerializer,
        tags=["races"],
    )
)
class RacesView(generics.ListAPIView):
    """Races: list them, make one."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticatedOrReadOnly]
    serializer_class = RaceSerializer

    def get_queryset(self) -> QuerySet[Race]:
        wanted, racer = read_as(FilterSerializer, self.request.query_params), self.request.user
        races = races_visible_to(racer).select_related("beside").defer("track__npy").order_by("-opens_at", "-pk")
        if "kind" in wanted:
            races = races.filter(kind=wanted["kind"])
        if "race_type" in wanted:
            races = races.filter(race_type=wanted["race_type"])
        if "state" in wanted:
            races = races.filter(_in_state(RaceState(wanted["state"])))
        if wanted["mine"]:
            if not isinstance(racer, Racer):
                return races.none()
            entered = Entry.objects.filter(racer_id=racer.pk, withdrawn_at=None)
            races = races.filter(Q(organiser_id=racer.pk) | Q(pk__in=entered.values("race")))
        return races

    @extend_schema(
        operation_id="create_race",
        summary="Make a race of your own; with a division, for admins, a race of the league",
        request=NewRaceSerializer,
        responses={201: RaceDetailSerializer},
        tags=["races"],
    )
    def post(self, request: Request) -> Response:
        wanted, now = read_as(NewRaceSerializer, request.data), timezone.now()
        if "division" not in wanted:
            race = services.create_community_race(organiser=racer_of(request), now=now, **wanted)
        elif request.user.is_staff and request.user.has_perm("races.add_race"):
            race = services.create_league_race(now=now, **wanted)
            log(request.user, race, ADDITION, "Made through the API")
        else:
            raise UserFault("race_league_admins")
        return Response(RaceDetailSerializer(race, context={"request": request}).data, status=status.HTTP_201_CREATED)


class RaceView(APIView):
    """One race."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(operation_id="read_race", summary="A race", responses=RaceDetailSerializer, tags=["races"])
    def get(self, request: Request, slug: str) -> Response:
        return self._answer(visible_race(request, slug))

    @extend_schema(
        operation_id="edit_race",
        summary="Change a race that you organise",
        description="What moves a result is fixed from the first submission on.",
        request=RaceEditSerializer,
        responses=RaceDetailSerializer,
        tags=["races"],
    )
    def patch(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        sent = read_as(RaceEditSerializer, request.data)
        return self._answer(services.edit_race(race=race, now=timezone.now(), **sent))

    def _answer(self, race: Race) -> Response:
        return Response(RaceDetailSerializer(race, context={"request": self.request}).data)


class CancelView(APIView):
    """Cancelling a race."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="cancel_race",
        summary="Cancel a race that you organise",
        request=CancelSerializer,
        responses=RaceDetailSerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        sent = read_as(CancelSerializer, request.data)
        race = services.cancel_race(race=race, now=timezone.now(), **sent)
        return Response(RaceDetailSerializer(race, context={"request": request}).data)


class CloseSerializer(Body):
    """How a race is closed."""

    duels_live_only = serializers.BooleanField(
        required=False, help_text="Of a race of models: its duels wait for a live event."
    )


class CloseView(APIView):
    """Closing a race before its time."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="close_race",
        summary="Close a race that you organise now",
        description=(
            "Nobody can submit a car any more; those that wait or drive still count. The duels of a race of models "
            "are then drawn and driven at once, unless a live event is planned or `duels_live_only` is set."
        ),
        request=CloseSerializer,
        responses=RaceDetailSerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        sent = read_as(CloseSerializer, request.data)
        race = services.close_race(race=organised_race(request, slug), now=timezone.now(), **sent)
        return Response(RaceDetailSerializer(race, context={"request": request}).data)


class InvitationResetView(APIView):
    """Another invitation link."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="reset_invitation",
        summary="Give a race that you organise a new invitation",
        description="The old one joins nobody any more; who has joined stays.",
        request=None,
        responses=RaceDetailSerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        refuse_fields(request)
        race = services.reset_invitation(race=organised_race(request, slug))
        return Response(RaceDetailSerializer(race, context={"request": request}).data)


class SpectatorLinkRenewView(APIView):
    """Another spectators' link."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="renew_spectator_link",
        summary="Give a race that you organise a new spectators' link",
        description="The old link opens nothing any more, and streams that were opened with it end.",
        request=None,
        responses=RaceDetailSerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        refuse_fields(request)
        race = services.renew_spectator_link(race=organised_race(request, slug), now=timezone.now())
        return Response(RaceDetailSerializer(race, context={"request": request}).data)


def _in_state(state: RaceState) -> Q:
    """The condition of Race.state_at, for the database."""
    now = timezone.now()
    if state == RaceState.CANCELLED:
        return Q(cancelled_at__isnull=False)
    during = {
        RaceState.UPCOMING: Q(opens_at__gt=now),
        RaceState.OPEN: Q(opens_at__lte=now, closes_at__gt=now),
        RaceState.CLOSED: Q(closes_at__lte=now),
    }
    return during[state] & Q(cancelled_at=None)

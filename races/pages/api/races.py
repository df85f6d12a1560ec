"""Races: list, read, create, change and cancel."""

from typing import NotRequired, TypedDict

from django.contrib.admin.models import ADDITION
from django.db.models import Q, QuerySet
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers
from rest_framework.request import Request

from accounts.models import Racer, RacerGroup
from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from core.api.bodies import Body
from core.api.fields import ComputedField, ZonedDateTimeField
from core.api.operations import operation
from core.api.views import APIView
from paddock.errors import UserFault
from paddock.rules.race import RULES
from tracks.api import TrackField

from ...boards.ranking import order_rule, rule_for
from ...entries.selectors.lists import in_state
from ...entries.selectors.visibility import can_organise, can_see_race, races_visible_to
from ...models import Division, Entry, Race, RaceKind, RaceState, RaceType, TeamEntries, Visibility
from ...models.race import MINIMUM_LAP_MS, MOST_TERMS, SESSION_S
from ...rules.layout import box_rows
from ...rules.serializers import with_rules
from ...web.api import organised_race, visible_race
from ...web.audit_log import log
from ...web.serializers import PlacedBoxSerializer, TrackSummarySerializer
from ...web.spectator_links import spectator_token
from .. import services


class RaceSerializer(with_rules(serializers.Serializer, RULES)):  # type: ignore[misc]
    """A race and its rules."""

    slug = serializers.CharField()
    kind = serializers.ChoiceField(RaceKind.choices)
    division = serializers.ChoiceField(Division.choices, allow_blank=True, help_text="Of a league race.")
    name = serializers.CharField()
    description = serializers.CharField(allow_blank=True)
    prize = serializers.CharField(allow_blank=True)
    sponsor = serializers.CharField(allow_blank=True)
    terms_version = serializers.IntegerField(help_text="Of the terms to accept on joining; 0: none.")
    organiser = serializers.CharField(source="organiser.alias", default=None, allow_null=True)
    state = ComputedField(serializers.ChoiceField(RaceState.choices), lambda race: race.state_at(timezone.now()))
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
        source="group.slug", default=None, allow_null=True, help_text="Only its members may enter; null: everybody."
    )
    physical = serializers.BooleanField(help_text="Real cars, timed at the track; nothing is simulated.")
    session_s = serializers.IntegerField(help_text="Of real cars: seconds that a racer has on the track.")
    minimum_lap_ms = serializers.IntegerField(help_text="Of real cars: two crossings closer together are one.")
    beside = serializers.SerializerMethodField(help_text="The simulated counterpart, where you may see it.")
    engine = serializers.CharField(
        allow_blank=True, help_text="The simulator that its counted results are of; empty before the first."
    )
    next_engine = serializers.CharField(
        allow_blank=True, help_text="The engine that reruns all counted runs; else empty."
    )

    @extend_schema_field({"type": "string", "nullable": True})
    def get_beside(self, race: Race) -> str | None:
        other = race.beside
        return None if other is None or not can_see_race(self.context["request"].user, other) else other.slug


class RaceDetailSerializer(RaceSerializer):
    """A race with its rules explained; its organiser also gets the invitation."""

    terms = serializers.CharField(allow_blank=True, help_text="To accept on joining.")
    placed_boxes = ComputedField(
        PlacedBoxSerializer(many=True),
        box_rows,
        help_text="Every box where it stands, drawn ones too, in the order driven.",
    )
    ranking_rule = ComputedField(
        serializers.CharField(),
        lambda race: rule_for(race).rule(race),
        help_text="In plain sentences, in the reader's language.",
    )
    tie_rule = ComputedField(serializers.CharField(), order_rule)
    edition = ComputedField(
        serializers.CharField(), services.edition_of, help_text="Another after every change; see the change of a race."
    )
    topic = ComputedField(
        serializers.CharField(), lambda race: f"race:{race.pk}", help_text="Its topic on the stream; live:… for poses."
    )
    invitation = serializers.SerializerMethodField(
        help_text="The secret of the invitation link; only for the organiser."
    )
    spectators = serializers.SerializerMethodField(
        help_text="The token of the spectators' link, /watch/TOKEN/; only for the organiser of a race by invitation."
    )

    def get_invitation(self, race: Race) -> str | None:
        return race.invitation if self._has_links(race) else None

    def get_spectators(self, race: Race) -> str | None:
        return spectator_token(race) if self._has_links(race) else None

    def _has_links(self, race: Race) -> bool:
        return race.visibility == Visibility.INVITATION and can_organise(self.context["request"].user, race)


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
        help_text="Racers accept them before joining, and again after a change.",
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
        help_text="Only its members may enter: a listed group, or one that you lead; null: everybody.",
    )


class RaceEditSerializer(RaceChangeSerializer):
    """A change, and of which state of the race."""

    edition = serializers.CharField(
        max_length=64,
        required=False,
        help_text="As the race was read: the change is refused if somebody else has changed it since.",
    )


class NewRaceSerializer(RaceChangeSerializer):
    """A new race; omitted fields get their defaults."""

    name = serializers.CharField(max_length=64)
    track = TrackField()
    opens_at = ZonedDateTimeField()
    closes_at = ZonedDateTimeField()
    division = serializers.ChoiceField(
        Division.choices, required=False, help_text="Makes it a race of the league; admins only."
    )


class FilterSerializer(serializers.Serializer):
    """Which races to list."""

    state = serializers.ChoiceField(RaceState.choices, required=False, help_text="As things stand now.")
    kind = serializers.ChoiceField(RaceKind.choices, required=False, help_text="Who holds it.")
    race_type = serializers.ChoiceField(RaceType.choices, required=False)
    mine = serializers.BooleanField(required=False, default=False, help_text="Only those that you are in or organise.")


class RaceQuery(TypedDict):
    """What :class:`FilterSerializer` reads."""

    state: NotRequired[str]
    kind: NotRequired[str]
    race_type: NotRequired[str]
    mine: bool


class CancelSerializer(Body):
    """Why."""

    reason = serializers.CharField(allow_blank=True, max_length=255, help_text="Everybody who entered reads it.")


class RacesView(APIView):
    token_scope = ORGANISE

    @operation(
        "list_races",
        "Races",
        query=FilterSerializer,
        answer=RaceSerializer,
        paged=True,
        description="Public ones, and those by invitation that you are in or organise; the latest first.",
    )
    def get(self, request: Request, wanted: RaceQuery) -> QuerySet[Race]:
        racer = request.user
        races = races_visible_to(racer).select_related("beside").defer("track__npy").order_by("-opens_at", "-pk")
        if "kind" in wanted:
            races = races.filter(kind=wanted["kind"])
        if "race_type" in wanted:
            races = races.filter(race_type=wanted["race_type"])
        if "state" in wanted:
            races = races.filter(in_state(wanted["state"], timezone.now()))
        if wanted["mine"]:
            if not isinstance(racer, Racer):
                return races.none()
            entered = Entry.objects.filter(racer_id=racer.pk, withdrawn_at=None)
            races = races.filter(Q(organiser_id=racer.pk) | Q(pk__in=entered.values("race")))
        return races

    @operation(
        "create_race",
        "Create a community race; admins create a league race with a division",
        body=NewRaceSerializer,
        answer=RaceDetailSerializer,
        status=201,
    )
    def post(self, request: Request, wanted: dict) -> Race:
        now = timezone.now()
        if "division" not in wanted:
            return services.create_community_race(organiser=racer_of(request), now=now, **wanted)
        if not (request.user.is_staff and request.user.has_perm("races.add_race")):
            raise UserFault("race_league_admins")
        race = services.create_league_race(now=now, **wanted)
        log(request.user, race, ADDITION, "Made through the API")
        return race


class RaceView(APIView):
    token_scope = ORGANISE

    @operation("read_race", "A race", find=visible_race, answer=RaceDetailSerializer)
    def get(self, request: Request, race: Race) -> Race:
        return race

    @operation(
        "edit_race",
        "Change a race that you organise",
        find=organised_race,
        body=RaceEditSerializer,
        answer=RaceDetailSerializer,
        description="Fields that affect results are fixed from the first submission.",
    )
    def patch(self, request: Request, race: Race, sent: dict) -> Race:
        return services.edit_race(race=race, now=timezone.now(), **sent)


class CancelView(APIView):
    token_scope = ORGANISE

    @operation(
        "cancel_race",
        "Cancel a race that you organise",
        find=organised_race,
        body=CancelSerializer,
        answer=RaceDetailSerializer,
    )
    def post(self, request: Request, race: Race, sent: dict) -> Race:
        return services.cancel_race(race=race, now=timezone.now(), **sent)


class CloseSerializer(Body):
    """How a race is closed."""

    duels_live_only = serializers.BooleanField(
        required=False, help_text="Of a race of models: its duels wait for a live event."
    )


class CloseView(APIView):
    token_scope = ORGANISE

    @operation(
        "close_race",
        "Close a race that you organise",
        find=organised_race,
        body=CloseSerializer,
        answer=RaceDetailSerializer,
        description=(
            "No more submissions; queued and driving cars still count. The duels of a race of models "
            "are then drawn and driven at once, unless a live event is planned or `duels_live_only` is set."
        ),
    )
    def post(self, request: Request, race: Race, sent: dict) -> Race:
        return services.close_race(race=race, now=timezone.now(), **sent)


class InvitationResetView(APIView):
    token_scope = ORGANISE

    @operation(
        "reset_invitation",
        "Replace the invitation link of a race that you organise",
        find=organised_race,
        answer=RaceDetailSerializer,
        description="The old link stops working. Racers who have joined stay.",
    )
    def post(self, request: Request, race: Race) -> Race:
        return services.reset_invitation(race=race)


class SpectatorLinkRenewView(APIView):
    token_scope = ORGANISE

    @operation(
        "renew_spectator_link",
        "Replace the spectators' link of a race that you organise",
        find=organised_race,
        answer=RaceDetailSerializer,
        description="The old link stops working, and streams that were opened with it end.",
    )
    def post(self, request: Request, race: Race) -> Race:
        return services.renew_spectator_link(race=race, now=timezone.now())

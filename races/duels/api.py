"""The duels of a race."""

from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.scopes import ORGANISE
from core.api.operations import operation
from core.api.views import APIView
from paddock.errors import UserFault

from ..models import DuelFormat, DuelState, Opponents, Race
from ..web.api import organised_race, visible_race
from .selectors import duels_of
from .services import draw_duels, drive_on


class DuelCompetitorSerializer(serializers.Serializer):
    """A car in a heat."""

    grid = serializers.IntegerField(help_text="Starting place, 1 in front.")
    racer = serializers.CharField(source="entry.racer.alias")
    seed = serializers.IntegerField(source="entry.seed", help_text="Place in qualifying.")
    place = serializers.IntegerField(allow_null=True)
    points = serializers.IntegerField(allow_null=True)
    laps = serializers.IntegerField(help_text="Complete ones.")
    time_ms = serializers.IntegerField(help_text="Of the complete laps.")
    forfeited = serializers.BooleanField(help_text="Its racer had left the race, so it did not start.")
    retired_code = serializers.CharField(allow_blank=True, help_text="The reason code that took it off the track.")


class HeatSerializer(serializers.Serializer):
    """A heat."""

    round = serializers.IntegerField(source="duel.round")
    number = serializers.IntegerField(
        source="duel.number",
        help_text="Within the round; in a bracket with `duel_heats` 2, heats 2n - 1 and 2n are tie n.",
    )
    state = serializers.ChoiceField(DuelState.choices, source="duel.state")
    decided_at = serializers.DateTimeField(source="duel.decided_at", allow_null=True)
    evaluation = serializers.CharField(
        source="duel.evaluation.public_id", default=None, allow_null=True, help_text="The public_id of its run."
    )
    cars = DuelCompetitorSerializer(many=True, help_text="The front one first.")


class DuelsSerializer(serializers.Serializer):
    """All duels of a race."""

    race = serializers.CharField(source="race.slug")
    duel_format = serializers.ChoiceField(DuelFormat.choices, source="race.duel_format")
    duel_cars = serializers.IntegerField(source="race.duel_cars", help_text="In a heat, if there are so many.")
    duel_heats = serializers.IntegerField(
        source="race.duel_heats", help_text="In a tie of a bracket; 3: best of three."
    )
    drawn_at = serializers.DateTimeField(
        source="duels.draw.drawn_at", default=None, allow_null=True, help_text="null while qualifying goes on."
    )
    over_at = serializers.DateTimeField(source="duels.draw.over_at", default=None, allow_null=True)
    entrants = serializers.IntegerField(source="duels.draw.entrants", default=0, help_text="Cars drawn.")
    decided = serializers.IntegerField(source="duels.decided", default=0, help_text="Heats that are over.")
    total = serializers.IntegerField(
        source="duels.total", default=0, help_text="Heats in all, those of a bracket's rounds to come included."
    )
    heats = HeatSerializer(
        source="duels.heats",
        default=[],
        many=True,
        help_text="In the order of rounds; those of a bracket as they become known.",
    )


class DuelsView(APIView):
    """The duels of a race."""

    token_scope = ORGANISE

    @operation(
        "read_duels",
        "The duels of a race",
        find=visible_race,
        answer=DuelsSerializer,
        description="Who meets whom, and how it went. Refused with `race_has_no_duels` for races of other kinds.",
    )
    def get(self, request: Request, race: Race) -> dict[str, object]:
        if race.opponents != Opponents.MODELS:
            raise UserFault("race_has_no_duels")
        return {"race": race, "duels": duels_of(race, request.user)}

    @operation(
        "draw_duels",
        "Draw the duels of a race that you organise",
        find=organised_race,
        answer=DuelsSerializer,
        description="Once it has closed. The platform does it by itself within a minute; again changes nothing.",
    )
    def post(self, request: Request, race: Race) -> Response:
        now = timezone.now()
        draw_duels(race=race, now=now)
        drive_on(race=race, now=now)
        return self.get(request, slug=race.slug)

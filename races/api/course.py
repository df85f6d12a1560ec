"""What stands and drives on the track of a race, as the API says it and takes it."""

from __future__ import annotations

from rest_framework import serializers

from core.bodies import Body
from paddock.simulator.rules import BOT_SPEED_RANGE_MPS, MAX_BOTS, MAX_BOXES, MAX_CARS

from ..models import DuelFormat, Lane, Opponents
from ..models.course import BOX_DISTANCES_M, BOX_FRACTIONS


def _range(least: float, most: float) -> str:
    return f"{least:g} to {most:g}"


class BoxPlaceSerializer(Body):
    """Where a box is put."""

    fraction = serializers.FloatField(
        help_text=f"Share of the lap driven there from the finish line, {_range(*BOX_FRACTIONS)}."
    )
    lane = serializers.ChoiceField(
        Lane.choices, help_text="Beside the track's inner or its outer border, in either direction."
    )


class CourseSerializer(serializers.Serializer):
    """Boxes, bots and opponents. Which go together, and their bounds, is checked with the whole race: each refusal has
    its own code."""

    boxes = BoxPlaceSerializer(
        many=True, required=False, help_text=f"Object avoidance: boxes in fixed places, up to {MAX_BOXES}."
    )
    random_boxes = serializers.IntegerField(
        required=False,
        help_text=f"Object avoidance: so many drawn from the seed instead, {_range(1, MAX_BOXES)}.",
    )
    box_distance_m = serializers.FloatField(
        required=False,
        help_text=f"Least distance of drawn boxes along the track, {_range(*BOX_DISTANCES_M)}.",
    )
    opponents = serializers.ChoiceField(
        Opponents.choices, required=False, allow_blank=True, help_text="Head-to-head: against whom."
    )
    bots = serializers.IntegerField(required=False, help_text=f"Against bots: how many, {_range(1, MAX_BOTS)}.")
    bot_speed_mps = serializers.FloatField(required=False, help_text=f"{_range(*BOT_SPEED_RANGE_MPS)}.")
    bot_lane_changes = serializers.BooleanField(required=False, help_text="At moments drawn from the seed.")
    duel_format = serializers.ChoiceField(
        DuelFormat.choices, required=False, allow_blank=True, help_text="Models against models: how cars are paired."
    )
    duel_cars = serializers.IntegerField(required=False, help_text=f"On the track at once, {_range(2, MAX_CARS)}.")

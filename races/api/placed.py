"""Boxes where they stand, as races and evaluations tell of them."""

from __future__ import annotations

from rest_framework import serializers

from paddock.rules.race import LANES


class PlacedBoxSerializer(serializers.Serializer):
    """A box on the track: the share of the lap driven there, its lane, and its middle and heading (m, rad)."""

    fraction = serializers.FloatField()
    lane = serializers.ChoiceField(LANES)
    x = serializers.FloatField()
    y = serializers.FloatField()
    yaw = serializers.FloatField()

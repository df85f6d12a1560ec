"""Serializers that the API of several features shares."""

from rest_framework import serializers

from core.api.documents import serializer_of
from core.api.fields import ComputedField
from paddock.simulator.layout import BoxDocument

from ..boards.selectors.board import rank_of
from ..models import Entry

PlacedBoxSerializer = serializer_of(BoxDocument, "PlacedBox")


class NamedSerializer(serializers.Serializer):
    """Something with an address and a name."""

    slug = serializers.CharField()
    name = serializers.CharField()


class TrackSummarySerializer(NamedSerializer):
    """Which track."""

    length_m = serializers.FloatField()


def submissions_left(entry: Entry) -> int | None:
    """How many cars the racer may still send; None for any number."""
    limit = entry.race.max_submissions
    return None if limit is None else max(0, limit - entry.submission_count)


class AcceptedTermsSerializer(serializers.Serializer):
    """Accepted terms."""

    version = serializers.IntegerField(source="terms.version")
    at = serializers.DateTimeField(source="accepted_at")


class EntrySerializer(serializers.Serializer):
    """A racer in a race, with the standing of the best submission. Times in milliseconds."""

    race = NamedSerializer()
    racer = serializers.CharField(source="racer.alias")
    entered_at = serializers.DateTimeField()
    withdrawn_at = serializers.DateTimeField(allow_null=True)
    removed_at = serializers.DateTimeField(allow_null=True)
    removal_reason = serializers.CharField(allow_blank=True)
    accepted_terms = ComputedField(
        AcceptedTermsSerializer(allow_null=True),
        lambda entry: entry.accepted_terms.select_related("terms").order_by("-terms__version").first(),
        help_text="The newest version of the race's terms that was accepted, and when; null for none.",
    )
    submission_count = serializers.IntegerField(help_text="Those that count.")
    submissions_left = ComputedField(
        serializers.IntegerField(allow_null=True), submissions_left, help_text="null: any number."
    )
    rank = ComputedField(serializers.IntegerField(allow_null=True), rank_of)
    classified = serializers.BooleanField()
    score_ms = serializers.IntegerField(allow_null=True, help_text="What the race ranks by.")
    average_ms = serializers.IntegerField(allow_null=True)
    best_lap_ms = serializers.IntegerField(allow_null=True)
    total_ms = serializers.IntegerField(allow_null=True)
    complete_laps = serializers.IntegerField()
    off_tracks = serializers.IntegerField()
    resets = serializers.IntegerField()
    evaluation = serializers.CharField(
        source="best.evaluation.public_id", default=None, allow_null=True, help_text="Of the best submission."
    )

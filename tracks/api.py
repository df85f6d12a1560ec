"""The API of tracks; all tracks are public."""

from typing import Any

import numpy as np
from django.db.models import QuerySet
from django.utils import timezone
from django.utils.translation import gettext
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers
from rest_framework.exceptions import NotFound
from rest_framework.parsers import MultiPartParser
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView
from paddock.geometry.catalogue.names import direction_in
from paddock.geometry.files import MAX_BYTES

from . import services
from .models import Direction, Track, TrackLook
from .selectors import figures, found_tracks, track_named, unknown_track, with_figures

NAME_HELP = "The track's slug, or any name of a catalogue track, such as `penbay_open`."
LINE = {
    "type": "array",
    "items": {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
    "description": "[x, y] in metres. The first point lies at the finish line and is not repeated at the end; on an "
    "open track it lies at the start, and the last one at the finish.",
}


@extend_schema_field(LINE)
class LineField(serializers.Field):
    """The waypoints of one line, read only; null where the track's shape is not known here."""

    def get_attribute(self, instance: Track) -> object:
        return super().get_attribute(instance) if instance.has_shape else None

    def to_representation(self, points: np.ndarray) -> list[list[float]]:
        return points.tolist()


class TrackField(serializers.SlugRelatedField):
    """A track by its address, or a catalogue track by another of its names."""

    def __init__(self, **options: Any) -> None:
        options.setdefault("queryset", Track.objects.all())
        options.setdefault("help_text", NAME_HELP)
        super().__init__(slug_field="slug", **options)

    def to_internal_value(self, data: Any) -> Track:
        """The track. Raises ValidationError with the closest names, or with the direction that the name asks for."""
        if not isinstance(data, str):
            return super().to_internal_value(data)
        track = track_named(data)
        if track is not None and track.slug != data and (direction := direction_in(data)):
            text = gettext("%(name)s is the track %(slug)s in one direction. Send this address and direction %(way)s.")
            message = text % {"name": data[:64], "slug": track.slug, "way": direction}
            raise serializers.ValidationError(message, code="track_direction")
        try:
            return super().to_internal_value(track.slug if track else data)
        except serializers.ValidationError as refused:
            raise serializers.ValidationError(unknown_track(data), code="does_not_exist") from refused


class TrackSerializer(serializers.Serializer):
    """A track, without its points."""

    slug = serializers.CharField()
    name = serializers.CharField()
    description = serializers.CharField(allow_blank=True)
    length_m = serializers.FloatField(allow_null=True, help_text="Of the centre line; null if no shape is known here.")
    width_m = serializers.FloatField(allow_null=True, help_text="Between the borders, median; null likewise.")
    corners = serializers.IntegerField(
        allow_null=True, help_text="Bends tighter than a radius of 5 m, 30 degrees or more."
    )
    difficulty = serializers.IntegerField(allow_null=True, help_text="0 to 100, as docs/tracks.md defines it.")
    direction = serializers.ChoiceField(
        Direction.choices, help_text="In which the file's own points run; of an open track from start to end."
    )
    is_open = serializers.BooleanField(help_text="Driven from its first point to its last, each lap anew.")
    fingerprint = serializers.CharField(help_text="sha-256 of the points.")
    look = serializers.ChoiceField(TrackLook.choices, help_text="What cameras see of it.")
    is_catalogue = serializers.BooleanField(help_text="One of Paddock's own tracks.")
    figures = serializers.SerializerMethodField(help_text="What was counted on it: `record` in ms or null, `raced`.")
    imported_by = serializers.CharField(source="owner.alias", default=None, allow_null=True)
    created_at = serializers.DateTimeField()

    @extend_schema_field({"type": "object", "additionalProperties": {"type": "integer", "nullable": True}})
    def get_figures(self, track: Track) -> dict[str, int | None]:
        """The figures of rooms above, by name; a track that was only just made has none."""
        return {each.name: getattr(track, each.column, None) for each in figures() if each.annotation is not None}


class TrackDetailSerializer(TrackSerializer):
    """A track with its points, in the file's own direction."""

    centre = LineField(source="geometry.centre", allow_null=True)
    inner = LineField(source="geometry.inner", allow_null=True)
    outer = LineField(source="geometry.outer", allow_null=True)


class FindSerializer(serializers.Serializer):
    """Which tracks to list, and in which order."""

    search = serializers.CharField(
        required=False,
        allow_blank=True,
        max_length=64,
        help_text="Part of any name, an address, or an importer's alias.",
    )

    def get_fields(self) -> dict[str, serializers.Field]:
        """With the figures of now: rooms above add theirs when the site starts."""
        fields = super().get_fields()
        names = [(each.name, each.label) for each in figures()]
        return {**fields, "sort": serializers.ChoiceField(choices=names, required=False)}


class ImportSerializer(Body):
    """A track to import."""

    file = serializers.FileField(
        allow_empty_file=True,
        help_text="The community's .npy form (centre x, y, inner x, y, outer x, y in metres), or a CSV centre line "
        "with widths; at most 2 MB.",
    )
    name = serializers.CharField(help_text="1 to 64 characters.")
    description = serializers.CharField(required=False, allow_blank=True, max_length=1000)
    look = serializers.ChoiceField(TrackLook.choices, required=False, help_text="What cameras see of it; for good.")
    scale = serializers.FloatField(required=False, help_text="What its metres are multiplied by.")
    least_width_m = serializers.FloatField(required=False, help_text="Where the road is narrower it becomes so wide.")
    is_open = serializers.BooleanField(
        required=False,
        help_text="It is meant to be driven from start to end. Without, the last point must meet the first.",
    )


class TracksView(APIView):
    token_scope = ORGANISE
    parser_classes = [MultiPartParser]

    @operation("list_tracks", "Tracks", query=FindSerializer, answer=TrackSerializer, paged=True)
    def get(self, request: Request, asked: dict[str, str]) -> QuerySet[Track]:
        return found_tracks(search=asked.get("search", ""), sort=asked.get("sort", ""))

    @operation("import_track", "Import a track", body=ImportSerializer, answer=TrackDetailSerializer, status=201)
    def post(self, request: Request, sent: dict[str, Any]) -> Track:
        # one byte more than a track may have, so that a huge file is refused without being read whole
        data = sent.pop("file").read(MAX_BYTES + 1)
        return services.import_track(data=data, owner=racer_of(request), now=timezone.now(), **sent)


class TrackView(APIView):
    @operation("read_track", "A track with its points", answer=TrackDetailSerializer)
    def get(self, request: Request, slug: str) -> Track:
        named = track_named(slug)
        if named is None:
            raise NotFound(unknown_track(slug))
        return with_figures(Track.objects.select_related("owner")).get(pk=named.pk)

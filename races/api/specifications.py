"""What a run is told, in full: enough to drive it again at home, and to compare the hash."""

from __future__ import annotations

from typing import Any

from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from evaluation.models import Evaluation, TrainedModel
from evaluation.selectors import can_see_model
from tracks.models import Track, TrackLook

from ..engines import site_engine
from ..layout import race_rules
from .evaluations import ModelSummarySerializer
from .lookup import visible_evaluation, visible_race


class DrivenTrackSerializer(serializers.Serializer):
    """Where it is driven."""

    slug = serializers.CharField()
    name = serializers.CharField()
    fingerprint = serializers.CharField(help_text="sha-256 of the track's points, which the track itself tells.")
    direction = serializers.CharField(help_text="In which it is driven: ccw or cw.")
    look = serializers.ChoiceField(TrackLook.choices, help_text="What cameras see of it.")


class SpecificationSerializer(serializers.Serializer):
    """What the simulator is told of a race."""

    engine = serializers.CharField(help_text="The simulator: results of two engines are not compared.")
    track = DrivenTrackSerializer()
    rules = serializers.DictField(help_text="Every rule of a run, those that no race changes among them.")


class SpecifiedCarSerializer(serializers.Serializer):
    """A car of a run."""

    number = serializers.IntegerField()
    racer = serializers.CharField()
    model = ModelSummarySerializer()
    open = serializers.BooleanField(help_text="Whether you may download its network: yours, or a shared one.")
    trace_sha256 = serializers.CharField(help_text="What it came to; empty before the result.", allow_blank=True)


class DrivenSpecificationSerializer(SpecificationSerializer):
    """What the simulator was told of a run, and what came of it."""

    state = serializers.CharField(help_text="As in the evaluation.")
    cars = SpecifiedCarSerializer(many=True, help_text="In the order of the grid.")


def _track(track: Track, direction: str, look: str) -> dict[str, Any]:
    return {
        "slug": track.slug,
        "name": track.name,
        "fingerprint": track.fingerprint,
        "direction": direction,
        "look": look,
    }


class RaceSpecificationView(APIView):
    """Of a race."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_race_specification",
        summary="What a run of a race is told: engine, track, every rule",
        responses=SpecificationSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        race = visible_race(request, slug)
        rules = race_rules(race)
        told = {
            "engine": site_engine(),
            "track": _track(race.track, rules.direction, race.track.look),
            "rules": rules.to_dict(),
        }
        return Response(SpecificationSerializer(told).data)


class EvaluationSpecificationView(APIView):
    """Of an evaluation."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_evaluation_specification",
        summary="What a run was told: engine, track, every rule, its cars and their hashes",
        description="Frozen when it was sent. With the networks of all cars the run can be driven again.",
        responses=DrivenSpecificationSerializer,
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> Response:
        evaluation = visible_evaluation(request, public_id)
        spec, result = evaluation.spec, getattr(evaluation, "result", None)
        told = {
            "engine": site_engine() if result is None else result.engine,
            "track": _track(evaluation.track, spec["rules"]["direction"], spec.get("look", TrackLook.OFFICIAL)),
            "rules": spec["rules"],
            "state": evaluation.state,
            "cars": _cars(request, evaluation),
        }
        return Response(DrivenSpecificationSerializer(told).data)


def _cars(request: Request, evaluation: Evaluation) -> list[dict[str, Any]]:
    result = getattr(evaluation, "result", None)
    hashes = {} if result is None else {0: result.trace_sha256}
    if result is not None:
        hashes |= {rival.number: rival.trace_sha256 for rival in result.rivals.all()}
    rivals = evaluation.rivals.select_related("model__owner").order_by("number")
    models: list[tuple[int, TrainedModel]] = [(0, evaluation.model), *((each.number, each.model) for each in rivals)]
    return [
        {
            "number": number,
            "racer": model.owner.alias,
            "model": model,
            "open": can_see_model(request.user, model),
            "trace_sha256": hashes.get(number, ""),
        }
        for number, model in models
    ]

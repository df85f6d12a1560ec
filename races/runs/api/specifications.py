"""The full specification of a run: enough to drive it again at home and compare the hash."""

from rest_framework import serializers
from rest_framework.request import Request

from core.api.operations import operation
from core.api.views import APIView
from evaluation.garage.api import ModelSummarySerializer
from evaluation.models import Evaluation, Result, TrainedModel
from evaluation.selectors import can_see_model
from tracks.models import Track, TrackLook

from ...entries.engines import site_engine
from ...models import Race
from ...rules.layout import race_rules
from ...web.api import visible_evaluation, visible_race
from ...web.serializers import NamedSerializer


class DrivenTrackSerializer(NamedSerializer):
    """Where it is driven."""

    fingerprint = serializers.CharField(help_text="sha-256 of the track's points.")
    direction = serializers.CharField(help_text="In which it is driven: ccw or cw.")
    look = serializers.ChoiceField(TrackLook.choices, help_text="What cameras see of it.")


class SpecificationSerializer(serializers.Serializer):
    """The simulator's input for a race."""

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
    """The simulator's input for a run, and its results."""

    state = serializers.CharField(help_text="As in the evaluation.")
    cars = SpecifiedCarSerializer(many=True, help_text="In the order of the grid.")


def _track(track: Track, direction: str, look: str) -> dict[str, str]:
    about = {"slug": track.slug, "name": track.name, "fingerprint": track.fingerprint}
    return about | {"direction": direction, "look": look}


class RaceSpecificationView(APIView):
    @operation(
        "read_race_specification",
        "Specification of a race's runs: engine, track, every rule",
        find=visible_race,
        answer=SpecificationSerializer,
    )
    def get(self, request: Request, race: Race) -> dict[str, object]:
        rules = race_rules(race)
        track = _track(race.track, rules.direction, race.track.look)
        return {"engine": site_engine(), "track": track, "rules": rules.to_dict()}


class EvaluationSpecificationView(APIView):
    @operation(
        "read_evaluation_specification",
        "Specification of a run: engine, track, every rule, its cars and their hashes",
        find=visible_evaluation,
        answer=DrivenSpecificationSerializer,
        description="Frozen when it was sent. With the networks of all cars the run can be driven again.",
    )
    def get(self, request: Request, evaluation: Evaluation) -> dict[str, object]:
        spec, result = evaluation.spec, getattr(evaluation, "result", None)
        return {
            "engine": site_engine() if result is None else result.engine,
            "track": _track(evaluation.track, spec["rules"]["direction"], spec.get("look", TrackLook.OFFICIAL)),
            "rules": spec["rules"],
            "state": evaluation.state,
            "cars": _cars(request, evaluation, result),
        }


def _cars(request: Request, evaluation: Evaluation, result: Result | None) -> list[dict[str, object]]:
    raced = [] if result is None else result.rivals.all()
    hashes = {rival.number: rival.trace_sha256 for rival in raced} | ({0: result.trace_sha256} if result else {})
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

"""The API that audits a reward function."""

from typing import Any

from rest_framework import serializers
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import TRAIN
from core.api.operations import operation
from core.api.views import APIView
from core.forms import explain
from tracks.api import TrackField
from tracks.models import Direction

from ..api import ProblemSerializer, RewardBody
from ..check_slots import described
from .services import audited
from .views import DEFAULT_DISCOUNT, DRIVE_NAMES, ENDED

DRIVES = list(DRIVE_NAMES)
ENDINGS = ["lap_complete", *ENDED]


class RewardAuditBody(RewardBody):
    """The function and its inputs."""

    track = TrackField()
    direction = serializers.ChoiceField(Direction.choices, default=Direction.CCW)
    discount_factor = serializers.FloatField(
        min_value=0.0, max_value=1.0, default=DEFAULT_DISCOUNT, help_text="Of the training."
    )


class AuditProblemSerializer(ProblemSerializer):
    """A problem of the function in an audit."""

    kind = serializers.CharField(help_text="syntax, import or test.")  # type: ignore[assignment]
    state = None  # type: ignore[assignment]
    count = serializers.IntegerField(help_text="In how many steps it came.")
    drive = serializers.ChoiceField(DRIVES, allow_null=True, help_text="In which it came first.")
    step = serializers.IntegerField(allow_null=True, help_text="Of that drive, from 1.")


class AuditFindingSerializer(serializers.Serializer):
    """One sentence on what the function pays for."""

    verdict = serializers.ChoiceField(["good", "bad", "note"])
    code = serializers.CharField(help_text="A reason code.")
    message = serializers.CharField()


class DriveRewardSerializer(serializers.Serializer):
    """One drive, and its rewards; these are null where the time was used up before."""

    drive = serializers.ChoiceField(DRIVES, source="drive.name")
    ended = serializers.ChoiceField(ENDINGS, source="drive.ended")
    lap_ms = serializers.IntegerField(source="drive.lap_ms", allow_null=True)
    progress = serializers.FloatField(source="drive.progress", help_text="Percent of the lap.")
    seconds = serializers.FloatField(source="drive.seconds")
    progress_per_second = serializers.FloatField(source="drive.progress_per_second")
    steps = serializers.IntegerField(source="drive.steps")
    failed = serializers.IntegerField(help_text="Steps without a valid reward, which count as 0.")
    total = serializers.FloatField(allow_null=True, help_text="Sum of the rewards.")
    step = serializers.FloatField(allow_null=True, help_text="Mean of the rewards.")
    worth = serializers.FloatField(
        allow_null=True,
        help_text="(1 - discount_factor) times the discounted sum of the rewards to come, as the mean over all steps.",
    )
    rank_by_time = serializers.IntegerField(source="by_time")
    rank_by_reward = serializers.IntegerField(source="by_reward", allow_null=True)

    def to_representation(self, instance: object) -> dict[str, object]:
        shown = super().to_representation(instance)
        if not instance.reached:  # type: ignore[attr-defined]
            shown |= dict.fromkeys(("total", "step", "worth", "rank_by_reward"))
        return shown


class RewardAuditSerializer(serializers.Serializer):
    """Whether a reward function pays for driving fast."""

    findings = AuditFindingSerializer(many=True)
    drives = DriveRewardSerializer(many=True, source="rows", help_text="Empty where the function could not start.")
    progress_correlation = serializers.FloatField(
        source="progress", allow_null=True, help_text="Rank correlation of worth and progress a second, -1 to 1."
    )
    lap_time_correlation = serializers.FloatField(
        source="lap_time", allow_null=True, help_text="Rank correlation of worth and lap time, -1 to 1; good is -1."
    )
    problems = AuditProblemSerializer(many=True)
    warnings = ProblemSerializer(many=True, help_text="Worth a look; it may be trained with all the same.")
    printed = serializers.CharField(allow_blank=True, help_text="The first of what it printed.")


class RewardAuditView(APIView):
    token_scope = TRAIN
    slow_methods = ("POST",)

    @operation(
        "audit_reward",
        "Audit a reward function",
        body=RewardAuditBody,
        answer={200: RewardAuditSerializer},
        description="Calls it at each step of eight recorded drives on a track, behind the sandbox: does it pay for "
        "driving fast? One at a time for each racer.",
    )
    def post(self, request: Request, sent: dict[str, Any]) -> Response:
        audit = audited(
            owner=racer_of(request),
            code=sent["reward_code"],
            track=sent["track"],
            direction=sent["direction"],
            race_type=sent["race_type"],
            discount=sent["discount_factor"],
        )
        answer = {
            "findings": [
                {"verdict": one.verdict, "code": one.fault.code, "message": explain(one.fault)}
                for one in audit.findings
            ],
            "rows": audit.rows,
            "progress": audit.progress,
            "lap_time": audit.lap_time,
            "problems": [
                {**described(one.problem), "count": one.count, "drive": one.drive, "step": one.step}
                for one in audit.failures
            ],
            "warnings": [{**described(warning), "state": None} for warning in audit.warnings],
            "printed": audit.printed,
        }
        return self.write(lambda: Response(RewardAuditSerializer(answer).data))

"""Reward functions: is this one, and what does it give?"""

from __future__ import annotations

from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import TRAIN
from accounts.who import racer_of
from core.bodies import Body, read_as
from core.forms import explain
from paddock.errors import UserFault
from races.models import RaceType
from training.checks import one_check

from .trainings import MOST_CODE

KINDS = ["syntax", "import", "test", "warning"]


class RewardBody(Body):
    """The function, and what it is for."""

    reward_code = serializers.CharField(
        trim_whitespace=False, allow_blank=True, max_length=MOST_CODE, help_text="Python with a reward_function."
    )
    race_type = serializers.ChoiceField(RaceType.choices, default=RaceType.TIME_TRIAL, help_text="What it is tried in.")


class ProblemSerializer(serializers.Serializer):
    """One thing that is wrong with a reward function."""

    line = serializers.IntegerField(allow_null=True, help_text="Counted from 1; null where it is not known.")
    kind = serializers.ChoiceField(KINDS, help_text="test: it failed when it ran.")
    code = serializers.CharField(help_text="A reason code.")
    message = serializers.CharField()
    state = serializers.CharField(allow_null=True, help_text="Of the car when it failed; null outside of the tries.")


class RewardReportSerializer(serializers.Serializer):
    """What came of trying a reward function."""

    valid = serializers.BooleanField(help_text="It may be trained with.")
    problems = ProblemSerializer(many=True)
    warnings = ProblemSerializer(many=True, help_text="Worth a look; it may be trained with all the same.")
    rewards = serializers.DictField(
        child=serializers.FloatField(), help_text="What it gave, by the state of the car, where it gave something."
    )
    printed = serializers.CharField(allow_blank=True, help_text="The first of what it printed.")


class RewardValidationView(APIView):
    """The wizard's check."""

    token_scope = TRAIN
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="validate_reward",
        summary="Check a reward function",
        description="Reads it and calls it in five states of a car on a track, behind the sandbox, as the wizard does "
        "and as beginning a training does. One at a time for each racer.",
        request=RewardBody,
        responses=RewardReportSerializer,
        tags=["trainings"],
    )
    def post(self, request: Request) -> Response:
        # brings the physics along, which no other operation needs
        from training.rewards.validate import check_reward

        sent = read_as(RewardBody, request.data)
        with one_check(racer_of(request)):
            report = check_reward(sent["reward_code"].replace("\r\n", "\n"), race_type=sent["race_type"])
        problems, warnings = (
            [
                {
                    "line": problem.line,
                    "kind": problem.kind,
                    "code": problem.code,
                    "message": explain(UserFault(problem.code, **problem.params)),
                    "state": problem.state,
                }
                for problem in found
            ]
            for found in (report.problems, report.warnings)
        )
        told = {
            "valid": not problems,
            "problems": problems,
            "warnings": warnings,
            "rewards": report.rewards,
            "printed": report.printed,
        }
        return Response(RewardReportSerializer(told).data)

"""The API that validates a reward function."""

from rest_framework import serializers
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import TRAIN
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView
from races.models import RaceType
from training.rewards.check_slots import checked, described

from .sandbox.static_checks import MAX_CHARACTERS

KINDS = ["syntax", "import", "test", "warning"]


class RewardBody(Body):
    """The function, and what it is for."""

    reward_code = serializers.CharField(
        trim_whitespace=False, allow_blank=True, max_length=MAX_CHARACTERS, help_text="Python with a reward_function."
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
    token_scope = TRAIN
    slow_methods = ("POST",)

    @operation(
        "validate_reward",
        "Check a reward function",
        body=RewardBody,
        answer={200: RewardReportSerializer},
        description="Reads it and calls it in five states of a car on a track, behind the sandbox, as the wizard does "
        "and as beginning a training does. One at a time for each racer.",
    )
    def post(self, request: Request, sent: dict[str, str]) -> Response:
        report = checked(racer_of(request), sent["reward_code"], sent["race_type"])
        problems, warnings = (
            [{**described(problem), "state": problem.state} for problem in found]
            for found in (report.problems, report.warnings)
        )
        answer = {"valid": not problems, "problems": problems, "warnings": warnings}
        answer |= {"rewards": report.rewards, "printed": report.printed}
        return self.write(lambda: Response(RewardReportSerializer(answer).data))

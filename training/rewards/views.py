"""The check of a reward function in the editor, and the form field of its text."""

from typing import Any, NotRequired, TypedDict

from django import forms
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, JsonResponse, QueryDict
from django.utils.functional import Promise
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_POST

from accounts.models import Racer
from accounts.request_racer import racer_of
from paddock.errors import PaddockError
from races.models import RaceType

from .check_slots import ProblemDocument, checked, described, described_refusal

STATE_NAMES = {
    "start": gettext_lazy("at the start"),
    "valid": gettext_lazy("on the road"),
    "progress": gettext_lazy("further on"),
    "off_track": gettext_lazy("off the track"),
    "finish": gettext_lazy("at the finish"),
}


class RewardCodeField(forms.CharField):
    """The text of a reward function, with line ends as Python counts them; forms send CR LF."""

    def __init__(self, *, rows: int = 1, **options: Any) -> None:
        attrs = {"rows": rows, "spellcheck": "false", "autocapitalize": "off", "class": "code"}
        options.setdefault("widget", forms.Textarea(attrs=attrs))
        super().__init__(label=gettext_lazy("Reward function"), strip=False, **options)

    def to_python(self, value: Any) -> str:
        return (super().to_python(value) or "").replace("\r\n", "\n")


@login_required
@require_POST
def reward_validate(request: HttpRequest) -> JsonResponse:
    """Check the function of the editor; 409 during another check of the racer, 503 after a fault of the platform."""
    answer = report_of(racer_of(request), request.POST)
    return JsonResponse(answer, status=answer.pop("status"))


class EditorReport(TypedDict):
    """The answer of :func:`reward_validate`, and its HTTP status."""

    problems: list[ProblemDocument]
    warnings: list[ProblemDocument]
    rewards: list[tuple[Promise, float]]
    printed: str
    status: NotRequired[int]


def report_of(owner: Racer, form: QueryDict) -> EditorReport:
    """The report on the function of a form, for a race of the form's type."""
    race_type = form.get("race_type", "")
    if race_type not in RaceType.values:
        race_type = RaceType.TIME_TRIAL
    try:
        report = checked(owner, form.get("reward_code", ""), race_type)
    except PaddockError as fault:
        problem, status = described_refusal(fault)
        return {"problems": [problem], "warnings": [], "rewards": [], "printed": "", "status": status}
    return {
        "problems": [described(problem) for problem in report.problems],
        "warnings": [described(warning) for warning in report.warnings],
        "rewards": [(STATE_NAMES[name], value) for name, value in report.rewards.items()],
        "printed": report.printed,
        "status": 200,
    }

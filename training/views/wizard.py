"""The wizard "Create a model", and what it asks the server while it is filled in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse, JsonResponse, QueryDict
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_http_methods, require_POST

from accounts.who import racer_of
from core.forms import add_fault, explain
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.rules.training import taken_from
from races.layout_form import preview
from races.models import RaceType
from training.checks import one_check, refusals
from training.forms.fields import MOST
from training.forms.hyperparameters import FILLS
from training.forms.training import RESET_RANGES, TrainingForm
from training.models import TrainingJob, Vehicle
from training.prefill import LACKS_VEHICLE, proposals, table
from training.rewards.examples import EXAMPLES
from training.services import create_training
from training.services.create import refusals_of, refuse_taken_name
from training.vehicles import vehicles_of

from .common import usage_of

if TYPE_CHECKING:
    from accounts.models import Racer

STEP_TITLES = (
    ("what", gettext_lazy("Name")),
    ("where", gettext_lazy("Track")),
    ("how", gettext_lazy("Algorithm")),
    ("actions", gettext_lazy("Action space")),
    ("vehicle", gettext_lazy("Vehicle")),
    ("reward", gettext_lazy("Reward function")),
    ("stop", gettext_lazy("When it ends")),
)
STATE_NAMES = {
    "start": gettext_lazy("at the start"),
    "valid": gettext_lazy("on the road"),
    "progress": gettext_lazy("further on"),
    "off_track": gettext_lazy("off the track"),
    "finish": gettext_lazy("at the finish"),
}


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def training_new(request: HttpRequest) -> HttpResponse:
    """Make a model: fill in the wizard, then train. Without a script some of its buttons come back to it: they make the
    table of actions, put ranges back, take other hyperparameters and check the reward function."""
    now = timezone.now()
    owner = racer_of(request)
    status, checked, lacking = 200, None, None
    if request.method == "POST":
        step = request.POST.get("do")
        form = TrainingForm(_REMAKING.get(step or "", _as_sent)(request.POST), owner=owner, now=now)
        if step in _REMAKING:
            form.errors.clear()
        elif step == "validate":
            form.errors.clear()
            checked = report_of(owner, request.POST)
        else:
            job, status = _create(form, owner, now)
            if job is not None:
                messages.success(request, _("Training queued. This page updates itself."))
                return redirect(job)
    else:
        initial = proposals(owner, request.GET)
        lacking = initial.pop(LACKS_VEHICLE, None)
        form = TrainingForm(owner=owner, now=now, initial=initial)
    context = {
        "form": form,
        "layout": preview(form, submitted=status != 200),
        "original": Vehicle(),
        "steps": STEP_TITLES,
        "vehicles": {vehicle.public_id: vehicle for vehicle in vehicles_of(owner)},
        "examples": EXAMPLES,
        "usage": usage_of(owner, now),
        "checked": checked,
        "lacking": lacking,
    }
    return render(request, "training/new.html", context, status=status)


def _create(form: TrainingForm, owner: Racer, now: datetime) -> tuple[TrainingJob | None, int]:
    """The training, or None and the status of the answer that says why not."""
    try:
        if form.is_valid():
            asked, rest = taken_from(form.values())
            _show_all(form, refusals_of(owner=owner, settings=asked, now=now, **rest))
        elif "name" in form.cleaned_data:
            _show_name(form, owner)
        if {"reward_code", "race_type"} <= set(form.cleaned_data):
            _show_all(form, refusals(owner, form.cleaned_data["reward_code"], form.cleaned_data["race_type"]))
        if form.errors:
            return None, 422
        return create_training(owner=owner, settings=asked, now=now, **rest), 302
    except UserFault as fault:
        form.show(fault)
        return None, 422
    except PlatformFault as fault:
        add_fault(form, fault)
        return None, 503


def _show_all(form: TrainingForm, faults: Iterable[UserFault]) -> None:
    for fault in list(faults):
        form.show(fault)


def _show_name(form: TrainingForm, owner: Racer) -> None:
    try:
        refuse_taken_name(owner, form.cleaned_data["name"])
    except UserFault as fault:
        form.show(fault)


@login_required
@require_POST
def reward_validate(request: HttpRequest) -> JsonResponse:
    """Check the reward function of the editor: ``{"problems": [{"line", "kind", "code", "message"}], "warnings": [the
    same], "rewards": {state: number}, "printed"}``; 409 while another one of the same racer is checked, 503 when
    Paddock could not."""
    answer = report_of(racer_of(request), request.POST)
    return JsonResponse(answer, status=answer.pop("status"))


def report_of(owner: Racer, said: QueryDict) -> dict[str, Any]:
    """What :func:`reward_validate` answers, and with it its status: a form says the function and a race type."""
    # brings the physics along, which no other page needs
    from training.rewards.validate import check_reward

    race_type = said.get("race_type", "")
    try:
        with one_check(owner):
            report = check_reward(
                said.get("reward_code", "").replace("\r\n", "\n"),
                race_type=race_type if race_type in RaceType.values else RaceType.TIME_TRIAL,
            )
    except PaddockError as fault:
        status = 503 if isinstance(fault, PlatformFault) else 409
        told = {"line": None, "kind": "", "code": fault.code, "message": explain(fault)}
        return {"problems": [told], "warnings": [], "rewards": {}, "printed": "", "status": status}
    return {
        "problems": [_told(problem) for problem in report.problems],
        "warnings": [_told(warning) for warning in report.warnings],
        "rewards": [[STATE_NAMES[name], value] for name, value in report.rewards.items()],
        "printed": report.printed,
        "status": 200,
    }


def _told(problem: Any) -> dict[str, Any]:
    fault = UserFault(problem.code, **problem.params)
    return {"line": problem.line, "kind": problem.kind, "code": problem.code, "message": explain(fault)}


def _with_table(said: QueryDict) -> QueryDict:
    """The same form with the table of actions that its granularities make."""
    data = said.copy()
    actions = table(said)
    for number in range(1, MOST + 1):
        action = actions[number - 1] if number <= len(actions) else None
        data[f"actions-{number}-steering"] = f"{action['steering_angle']:g}" if action else ""
        data[f"actions-{number}-speed"] = f"{action['speed']:g}" if action else ""
    return data


def _as_sent(said: QueryDict) -> QueryDict:
    return said


def _with_ranges(said: QueryDict, ranges: Mapping[str, Sequence[float]]) -> QueryDict:
    """The same form with these ranges of a continuous action space."""
    data = said.copy()
    for short, ends in ranges.items():
        for end, value in zip(("low", "high"), ends, strict=True):
            data[f"{short}_{end}"] = f"{value:g}"
    return data


def _with_hyperparameters(said: QueryDict, values: Mapping[str, Mapping[str, str]]) -> QueryDict:
    """The same form with these hyperparameters of the algorithm that it says."""
    data = said.copy()
    for name, value in values.get(said.get("algorithm", ""), {}).items():
        data[name] = value
    return data


# What a button of the form makes anew, by what it says.
_REMAKING: dict[str, Callable[[QueryDict], QueryDict]] = {
    "table": _with_table,
    **{name: partial(_with_ranges, ranges=ranges) for name, ranges in RESET_RANGES.items()},
    **{name: partial(_with_hyperparameters, values=values) for name, values in FILLS.items()},
}

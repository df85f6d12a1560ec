"""The pages of the wizard."""

from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from functools import partial

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse, QueryDict
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_http_methods

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.forms import add_fault
from paddock.errors import PlatformFault, UserFault
from paddock.rules.training import taken_from
from training.jobs.services.creation import create_training, refusals_of, refuse_taken_name
from training.models import TrainingJob
from training.rewards.audit.views import audit_of
from training.rewards.check_slots import refusals
from training.rewards.views import report_of
from training.wizard.fields import MOST, OwnRows
from training.wizard.forms import RESET_RANGES, TrainingForm
from training.wizard.hyperparameters import FILLS
from training.wizard.parts import parts_of
from training.wizard.prefill import LACKS_VEHICLE, proposals, table
from training.wizard.sweep import SweepForm, begin_sweep

from ..jobs.selectors import closed_because, training_quotas

STEP_TITLES = (
    ("what", gettext_lazy("Name")),
    ("where", gettext_lazy("Track")),
    ("how", gettext_lazy("Algorithm")),
    ("actions", gettext_lazy("Action space")),
    ("vehicle", gettext_lazy("Vehicle")),
    ("reward", gettext_lazy("Reward function")),
    ("stop", gettext_lazy("When it ends")),
)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def training_new(request: HttpRequest) -> HttpResponse:
    """The wizard. Without a script some buttons come back to it: they fill in values or check the reward function."""
    now = timezone.now()
    owner = racer_of(request)
    status, checked, audit, lacking = 200, None, None, None
    read = OwnRows(owner)
    tried: SweepForm | None = None
    if request.method == "POST":
        tried = SweepForm(request.POST, owner=owner, read=read)
        step = request.POST.get("do")
        data = request.POST.copy()
        if step in _FILLED:
            data.update(_FILLED[step](request.POST))  # of two values of a name the last counts
        form = TrainingForm(data, owner=owner, now=now, read=read)
        if step != "sweep":
            tried.errors.clear()
        if step in _FILLED:
            form.errors.clear()
        elif step == "validate":
            form.errors.clear()
            checked = report_of(owner, request.POST)
        elif step == "audit":
            form.errors.clear()
            audit, _status = audit_of(owner, request.POST)
        elif step == "sweep":
            sweep, status = begin_sweep(form, tried, owner, now)
            if sweep is not None:
                messages.success(request, _("Sweep queued. This page updates itself."))
                return redirect(sweep)
        else:
            job, status = _create(form, owner, now)
            if job is not None:
                messages.success(request, _("Training queued. This page updates itself."))
                return redirect(job)
    else:
        initial = proposals(owner, request.GET, read)
        lacking = initial.pop(LACKS_VEHICLE, None)
        form = TrainingForm(owner=owner, now=now, read=read, initial=initial)
    context = {
        "form": form,
        "tried": tried,
        "opens_sweep": "sweep" in request.GET or request.POST.get("do") == "sweep",
        "parts": parts_of(form, tried, read, submitted=status != 200, checked=checked, audit=audit),
        "steps": STEP_TITLES,
        "quotas": training_quotas(owner, now),
        "closed": closed_because(),
        "lacking": lacking,
    }
    return render(request, "training/wizard/new.html", context, status=status)


def _create(form: TrainingForm, owner: Racer, now: datetime) -> tuple[TrainingJob | None, int]:
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


def _table(sent: QueryDict) -> dict[str, str]:
    actions: list[Mapping[str, float] | None] = [*table(sent)]
    values = {}
    for number, action in enumerate(actions + [None] * (MOST - len(actions)), start=1):
        values[f"actions-{number}-steering"] = f"{action['steering_angle']:g}" if action else ""
        values[f"actions-{number}-speed"] = f"{action['speed']:g}" if action else ""
    return values


def _ranges(sent: QueryDict, name: str) -> dict[str, str]:
    named = RESET_RANGES[name].items()
    return {f"{short}_{end}": f"{ends[at]:g}" for short, ends in named for at, end in enumerate(("low", "high"))}


def _hyperparameters(sent: QueryDict, name: str) -> Mapping[str, str]:
    return FILLS[name].get(sent.get("algorithm", ""), {})


# The values that a button fills in, by the button's submitted value.
_FILLED: dict[str | None, Callable[[QueryDict], Mapping[str, str]]] = {
    "table": _table,
    **{name: partial(_ranges, name=name) for name in RESET_RANGES},
    **{name: partial(_hyperparameters, name=name) for name in FILLS},
}

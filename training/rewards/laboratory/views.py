"""The page of the reward laboratory."""

import csv
import io
from functools import lru_cache
from typing import Any, cast

from django import forms
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.safestring import mark_safe
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_http_methods

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.forms import explain
from evaluation.models import Evaluation, State
from evaluation.running.results import read_layout, read_trace
from paddock.errors import PaddockError, PlatformFault
from paddock.geometry.track import TrackGeometry
from paddock.simulator.solids import box
from races.entries.engines import hidden_runs
from races.replays.selectors import direction_of
from tracks.forms import label_directions
from tracks.models import Direction, Track
from training.rewards.check_slots import one_check
from training.rewards.examples import DEFAULT, EXAMPLES

from ..audit.views import audit_of
from ..sandbox.function import Params
from ..sandbox.static_checks import MAX_CHARACTERS
from ..views import RewardCodeField, report_of

RUNS_OFFERED = 20
PILOT, SWAYING, INNER, OUTER = "pilot", "swaying", "inner", "outer"
SWAY = 0.3  # of the road's width, to either side
SHOWN_PROBLEMS = 5


class LabForm(forms.Form):
    track = forms.ModelChoiceField(
        label=gettext_lazy("Track"),
        queryset=Track.objects.exclude(length_m=None).defer("npy"),
        to_field_name="slug",
        empty_label=None,
    )
    direction = forms.ChoiceField(label=gettext_lazy("Direction"), choices=Direction.choices)
    drive = forms.ChoiceField(
        label=gettext_lazy("Drive"),
        help_text=gettext_lazy("A reference lap on this track, or the first lap of one of your runs on its track."),
    )
    reward_code = RewardCodeField(rows=16, max_length=MAX_CHARACTERS)
    before = RewardCodeField(required=False, max_length=MAX_CHARACTERS, widget=forms.HiddenInput)

    def __init__(self, *args: Any, owner: Racer, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        track: Any = self.fields["track"]
        track.label_from_instance = lambda one: f"{one.name} · {one.length_m:.2f} m"
        label_directions(self)
        runs = Evaluation.objects.filter(~hidden_runs(), owner=owner, state=State.FINISHED)
        runs = runs.select_related("model", "track")
        self.runs = {run.public_id: run for run in runs.order_by("-ended_at")[:RUNS_OFFERED]}
        cast("forms.ChoiceField", self.fields["drive"]).choices = [
            (SWAYING, _("Reference lap: weaving")),
            (PILOT, _("Reference lap: centre line")),
            (INNER, _("Reference lap: inner border")),
            (OUTER, _("Reference lap: outer border")),
            *((run.public_id, f"{run.model.name} · {run.track.name}") for run in self.runs.values()),
        ]


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def reward_lab(request: HttpRequest) -> HttpResponse:
    initial = {"track": "oval", "direction": "ccw", "drive": SWAYING, "reward_code": DEFAULT.code}
    form = LabForm(request.POST or None, owner=racer_of(request), initial=initial)
    context: dict[str, object] = {"form": form, "examples": EXAMPLES}
    status = 200
    if request.POST.get("do") == "validate":
        form.errors.clear()
        context["checked"] = report_of(racer_of(request), request.POST)
    elif request.POST.get("do") == "audit":
        form.errors.clear()
        context["audit"], status = audit_of(racer_of(request), request.POST)
    elif request.method == "POST":
        status = 422
        if form.is_valid():
            try:
                with one_check(racer_of(request)):
                    context |= _maps(form)
                status = 200
            except PaddockError as fault:
                form.add_error(None, forms.ValidationError(explain(fault), code=fault.code))
                status = 503 if isinstance(fault, PlatformFault) else 422
    if request.headers.get("HX-Request"):
        return render(request, "training/rewards/parts/maps.html", context)
    return render(request, "training/rewards/laboratory.html", context, status=status)


def _maps(form: LabForm) -> dict[str, object]:
    """The heat map of the function, and of its difference to the one before. Raises PaddockError."""
    # the simulator comes along, which no other page needs
    from training.rewards.laboratory.heat_map import difference_map, heat_map
    from training.rewards.laboratory.recorded_lap import rewards_along

    data = form.cleaned_data
    track, states = _drive(form)
    now = rewards_along(data["reward_code"], states)
    known = [reward for reward in now.rewards if reward is not None]
    context = {
        "problems": [explain(each.fault) for each in now.problems[:SHOWN_PROBLEMS]],
        "warnings": [explain(each.fault) for each in now.warnings[:SHOWN_PROBLEMS]],
        "printed": now.printed,
        "points": len(states),
        "sum": sum(known),
        "mean": sum(known) / len(known) if known else None,
        "code": data["reward_code"],
    }
    if known:
        context["map"] = mark_safe(
            heat_map(track, states, now.rewards, label=_("reward"), title=_("Reward on the track"))
        )
    if known and data["before"] and data["before"] != data["reward_code"]:
        earlier = rewards_along(data["before"], states)
        old = [reward for reward in earlier.rewards if reward is not None]
        if old:
            title = _("Effect of the change")
            drawn = difference_map(track, states, earlier.rewards, now.rewards, label=_("change"), title=title)
            context |= {"difference": mark_safe(drawn), "sum_before": sum(old)}
    return context


def _drive(form: LabForm) -> tuple[Any, list[Params]]:
    data = form.cleaned_data
    run = form.runs.get(data["drive"])
    if run is None:
        track, direction = data["track"].geometry, data["direction"]
        aside = SWAY * track.width_at(0.0)
        left = aside if direction == Direction.CCW else -aside  # the inner border as seen from the car
        offset = {INNER: left, OUTER: -left}.get(data["drive"], 0.0)
        states = _lap(track, direction, offset, aside if data["drive"] == SWAYING else 0.0)
        return track.in_direction(direction), states
    track, states, _columns = driven_lap(run, 0)
    return track, states


def driven_lap(run: Evaluation, episode: int) -> tuple[TrackGeometry, list[Params], dict[str, list[Any]]]:
    """The driven track, the params along a lap of a run (from 0), and all columns of its trace. Raises PaddockError."""
    from training.rewards.laboratory.recorded_lap import params_along

    columns = trace_columns(read_trace(run.result))
    solids = [box(each["x"], each["y"], each["yaw"]) for each in read_layout(run.result).get("boxes", ())]
    track = run.track.geometry.in_direction(direction_of(run))
    return track, params_along(track, columns, solids=solids, episode=episode), columns


@lru_cache(maxsize=32)
def _lap(track: Any, direction: str, offset_m: float, sway_m: float) -> list[Params]:
    from training.rewards.laboratory.recorded_lap import record_lap

    return record_lap(track, direction, offset_m=offset_m, sway_m=sway_m)


def trace_columns(trace_csv: bytes) -> dict[str, list[Any]]:
    """The columns of a sim-trace with numbers and truth values."""
    rows = list(csv.DictReader(io.StringIO(trace_csv.decode())))
    return {name: [_value(row[name]) for row in rows] for name in rows[0]} if rows else {}


def _value(text: str) -> Any:
    if text in ("True", "False"):
        return text == "True"
    try:
        return float(text)
    except ValueError:
        return text

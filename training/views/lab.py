"""The reward laboratory: what a reward function gives at each point of a drive, and what a change of it changes."""

from __future__ import annotations

import csv
import io
from functools import lru_cache
from typing import TYPE_CHECKING, Any, cast

from django import forms
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.safestring import mark_safe
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_http_methods

from accounts.who import racer_of
from core.forms import explain
from evaluation.models import Evaluation, State
from evaluation.services.results import read_layout, read_trace
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.simulator.solids import box
from races.engines import hidden_runs
from tracks.models import Direction, Track
from tracks.ways import say_ways
from training.checks import one_check
from training.rewards.examples import DEFAULT, EXAMPLES

from .wizard import report_of

if TYPE_CHECKING:
    from accounts.models import Racer

RUNS_OFFERED = 20
PILOT, SWAYING, INNER, OUTER = "pilot", "swaying", "inner", "outer"
SWAY = 0.3  # of the road's width, to either side
MOST_CODE = 140_000
SHOWN_PROBLEMS = 5


class LabForm(forms.Form):
    """Which drive, and which function."""

    track = forms.ModelChoiceField(
        label=gettext_lazy("Track"), queryset=Track.objects.none(), to_field_name="slug", empty_label=None
    )
    direction = forms.ChoiceField(label=gettext_lazy("Direction"), choices=Direction.choices)
    drive = forms.ChoiceField(
        label=gettext_lazy("Drive"),
        help_text=gettext_lazy("A reference lap on this track, or the first lap of one of your runs on its track."),
    )
    reward_code = forms.CharField(
        label=gettext_lazy("Reward function"),
        strip=False,
        max_length=MOST_CODE,
        widget=forms.Textarea(attrs={"rows": 16, "spellcheck": "false", "autocapitalize": "off", "class": "code"}),
    )
    before = forms.CharField(required=False, strip=False, max_length=MOST_CODE, widget=forms.HiddenInput)

    def __init__(self, *args: Any, owner: Racer, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        track: Any = self.fields["track"]
        track.queryset = Track.objects.exclude(length_m=None).defer("npy")
        track.label_from_instance = lambda one: f"{one.name} · {one.length_m:.2f} m"
        say_ways(self)
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

    def clean_reward_code(self) -> str:
        """With line ends as Python counts them."""
        return self.cleaned_data["reward_code"].replace("\r\n", "\n")

    def clean_before(self) -> str:
        """With line ends as Python counts them."""
        return self.cleaned_data["before"].replace("\r\n", "\n")


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def reward_lab(request: HttpRequest) -> HttpResponse:
    """Choose a drive and a function, see the map; change the function, see what changed."""
    initial = {"track": "oval", "direction": "ccw", "drive": SWAYING, "reward_code": DEFAULT.code}
    form = LabForm(request.POST or None, owner=racer_of(request), initial=initial)
    context: dict[str, Any] = {"form": form, "examples": EXAMPLES}
    status = 200
    if request.POST.get("do") == "validate":
        form.errors.clear()
        context["checked"] = report_of(racer_of(request), request.POST)
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
        return render(request, "learn/parts/maps.html", context)
    return render(request, "learn/laboratory.html", context, status=status)


def _maps(form: LabForm) -> dict[str, Any]:
    """The heat map of the function, and of its difference to the one before. Raises PaddockError."""
    # the simulator comes along, which no other page needs
    from training.rewards.heat import difference_map, heat_map
    from training.rewards.laboratory import rewards_along

    said = form.cleaned_data
    track, states = _drive(form)
    now = rewards_along(said["reward_code"], states)
    known = [reward for reward in now.rewards if reward is not None]
    context = {
        "problems": [explain(UserFault(each.code, **each.params)) for each in now.problems[:SHOWN_PROBLEMS]],
        "warnings": [explain(UserFault(each.code, **each.params)) for each in now.warnings[:SHOWN_PROBLEMS]],
        "printed": now.printed,
        "points": len(states),
        "sum": sum(known),
        "mean": sum(known) / len(known) if known else None,
        "code": said["reward_code"],
    }
    if known:
        context["map"] = mark_safe(
            heat_map(track, states, now.rewards, label=_("reward"), title=_("Reward on the track"))
        )
    if known and said["before"] and said["before"] != said["reward_code"]:
        earlier = rewards_along(said["before"], states)
        old = [reward for reward in earlier.rewards if reward is not None]
        if old:
            title = _("Effect of the change")
            drawn = difference_map(track, states, earlier.rewards, now.rewards, label=_("change"), title=title)
            context |= {"difference": mark_safe(drawn), "sum_before": sum(old)}
    return context


def _drive(form: LabForm) -> tuple[Any, list[dict[str, Any]]]:
    """The track in the driven direction, and the params at each point of the drive."""
    said = form.cleaned_data
    run = form.runs.get(said["drive"])
    if run is None:
        track, direction = said["track"].geometry, said["direction"]
        aside = SWAY * track.width_at(0.0)
        left = aside if direction == Direction.CCW else -aside  # where the inner border is, for whoever drives
        offset = {INNER: left, OUTER: -left}.get(said["drive"], 0.0)
        states = _lap(track, direction, offset, aside if said["drive"] == SWAYING else 0.0)
        return track.in_direction(direction), states
    from training.rewards.laboratory import params_along

    rows = list(csv.DictReader(io.StringIO(read_trace(run.result).decode())))
    columns = {name: [_value(row[name]) for row in rows] for name in rows[0]} if rows else {}
    solids = [box(each["x"], each["y"], each["yaw"]) for each in read_layout(run.result).get("boxes", ())]
    track = run.track.geometry.in_direction(run.spec["rules"].get("direction", "ccw"))
    return track, params_along(track, columns, solids=solids, episode=0)


@lru_cache(maxsize=32)
def _lap(track: Any, direction: str, offset_m: float, sway_m: float) -> list[dict[str, Any]]:
    from training.rewards.laboratory import record_lap

    return record_lap(track, direction, offset_m=offset_m, sway_m=sway_m)


def _value(text: str) -> Any:
    if text in ("True", "False"):
        return text == "True"
    try:
        return float(text)
    except ValueError:
        return text

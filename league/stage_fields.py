"""The fields of a season's form for one stage: what its races are by turns, what then stands on the track, which
sensors are offered, and by which rules they are ranked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from evaluation.templatetags.garage import SENSOR_NAMES
from paddock.simulator.rules import BOT_SPEED_RANGE_MPS, MAX_BOTS, MAX_BOXES, MAX_CARS, RaceRules
from races.fields import PlainNumberField, ResetsField, SecondsField
from races.models import DuelFormat, RankingMethod
from races.models.course import BOX_DISTANCES_M
from races.sensors import OFFERABLE

from .models import Stage
from .services.template import StagePlan, Turn

STAGES = (Stage.OPEN, Stage.PRO, Stage.FINALE, Stage.CHAMPIONSHIP)
TURNS = ("turn_1", "turn_2", "turn_3")
AS_PRO = "as_pro"  # what stands on the track as in the pro race of the month
BOXES, BOTS, DUELS = (
    ("random_boxes", "box_distance_m"),
    ("bots", "bot_speed_mps", "bot_lane_changes"),
    ("duel_format", "duel_cars"),
)
LAYOUT = (*BOXES, *BOTS, *DUELS)
RULES = (
    *("ranking_method", "laps", "minimum_laps", "off_track_penalty_ms", "collision_penalty_ms"),
    *("max_resets", "max_simulated_ms", "max_submissions"),
)
_LAYOUT_PROPOSED: dict[str, Any] = {
    "random_boxes": 4,
    "box_distance_m": 2.0,
    "bots": 4,
    "bot_speed_mps": 1.0,
    "bot_lane_changes": True,
    "duel_format": DuelFormat.BRACKET,
    "duel_cars": 2,
}
_CAMERA = ["FRONT_FACING_CAMERA"]


def _proposed(turns: tuple[str, ...], sensors: list[str], *rules: Any) -> dict[str, Any]:
    ranking, laps, minimum, off_track, submissions = rules
    return {
        **_LAYOUT_PROPOSED,
        **dict(zip(TURNS, (*turns, "", ""), strict=False)),
        "sensors": sensors,
        "ranking_method": ranking,
        "laps": laps,
        "minimum_laps": minimum,
        "off_track_penalty_ms": off_track,
        "collision_penalty_ms": 3000,
        "max_resets": 10_000,
        "max_simulated_ms": 360_000,
        "max_submissions": submissions,
    }


# As the official league's were in 2021 and 2022: newcomers drive alone with a camera, pros meet boxes and bots by turns
# with every sensor. A newcomer's car may leave the road; a finale asks for more, and lets one try less often.
PROPOSALS: dict[str, dict[str, Any]] = {
    Stage.OPEN: _proposed(
        (Turn.TIME_TRIAL,),
        _CAMERA,
        *(RankingMethod.AVERAGE, RaceRules.laps, RaceRules.laps, RaceRules.off_track_penalty_ms, 50),
    ),
    Stage.PRO: _proposed((Turn.BOXES, Turn.BOTS), [*OFFERABLE], RankingMethod.AVERAGE, 5, 3, 5000, 50),
    Stage.FINALE: _proposed((AS_PRO,), [*OFFERABLE], RankingMethod.TOTAL, 3, 3, 5000, 10),
    Stage.CHAMPIONSHIP: _proposed((Turn.MODELS,), [*OFFERABLE], RankingMethod.TOTAL, 5, 5, 5000, 10),
}


def stage_fields(stage: Stage) -> dict[str, forms.Field]:
    """The fields of a stage by their names in the form, each with its proposal."""
    made = {**_turns(stage), **_layout(), **_rules()}
    for name, shown in made.items():
        shown.initial = PROPOSALS[stage][name]
        if name in RULES or name in TURNS:
            shown.widget.attrs["aria-label"] = _("%(stage)s: %(field)s") % {"stage": stage.label, "field": shown.label}
    return {named(stage, name): shown for name, shown in made.items()}


def named(stage: Stage, name: str) -> str:
    """The name of a stage's field in the form."""
    return f"{stage.name.lower()}_{name}"


def stage_plan(stage: Stage, data: Mapping[str, Any]) -> StagePlan:
    """What the cleaned data of the form say of a stage."""
    own = {name: data[named(stage, name)] for name in (*TURNS, *LAYOUT, *RULES, "sensors")}
    turns = [own[name] for name in TURNS if own[name]]
    return StagePlan(
        turns=() if turns == [AS_PRO] else turns,
        layout={name: _LAYOUT_PROPOSED[name] if own[name] in (None, "") else own[name] for name in LAYOUT},
        sensors=own["sensors"],
        rules={name: own[name] for name in RULES},
    )


def _turns(stage: Stage) -> dict[str, forms.Field]:
    of_a_finale = stage in (Stage.FINALE, Stage.CHAMPIONSHIP)
    first = [(AS_PRO, _("as its pro race")), *Turn.choices] if of_a_finale else Turn.choices
    again = [("", _("again from the first")), *Turn.choices]
    fields: dict[str, forms.Field] = {"turn_1": forms.ChoiceField(label=_("First race"), choices=first)}
    for name, label in (("turn_2", _("Second race")), ("turn_3", _("Third race"))):
        fields[name] = forms.ChoiceField(label=label, choices=again, required=False)
    if stage == Stage.CHAMPIONSHIP:
        fields["turn_1"].label = _("Race type")
        for name in TURNS[1:]:
            fields[name].widget = forms.HiddenInput()
    return fields


def _number(field: type[forms.Field], label: Any, least: float, most: float, **more: Any) -> forms.Field:
    return field(label=label, min_value=least, max_value=most, **more)


def _optional(field: type[forms.Field], label: Any, least: float, most: float, **more: Any) -> forms.Field:
    """A number that only some race types have; empty: as proposed."""
    return _number(field, label, least, most, required=False, **more)


def _layout() -> dict[str, forms.Field]:
    return {
        "random_boxes": _optional(
            forms.IntegerField, _("Boxes"), 1, MAX_BOXES, help_text=_("Their places are drawn anew for each month.")
        ),
        "box_distance_m": _optional(PlainNumberField, _("Metres between boxes at least"), *BOX_DISTANCES_M),
        "bots": _optional(forms.IntegerField, _("How many bots"), 1, MAX_BOTS),
        "bot_speed_mps": _optional(PlainNumberField, _("Their speed in m/s"), *BOT_SPEED_RANGE_MPS),
        "bot_lane_changes": forms.BooleanField(label=_("They change lanes"), required=False),
        "duel_format": forms.ChoiceField(label=_("Duels"), choices=DuelFormat.choices, required=False),
        "duel_cars": _optional(forms.IntegerField, _("Cars on the track at once"), 2, MAX_CARS),
        "sensors": forms.MultipleChoiceField(
            label=_("Sensors offered"),
            choices=[(name, _(SENSOR_NAMES[name])) for name in OFFERABLE],
            widget=forms.CheckboxSelectMultiple,
        ),
    }


def _rules() -> dict[str, forms.Field]:
    return {
        "ranking_method": forms.ChoiceField(label=_("Ranked by"), choices=RankingMethod.choices),
        "laps": _number(forms.IntegerField, _("Laps driven"), 1, 20),
        "minimum_laps": _number(forms.IntegerField, _("Laps in a row"), 1, 20),
        "off_track_penalty_ms": _number(SecondsField, _("Penalty in seconds"), 0, 60),
        "collision_penalty_ms": _number(SecondsField, _("Collision penalty in seconds"), 0, 60),
        "max_resets": ResetsField(label=_("Resets allowed")),
        "max_simulated_ms": _number(SecondsField, _("Time limit in seconds"), 10, 1200),
        "max_submissions": _number(forms.IntegerField, _("Submissions"), 1, 1000),
    }

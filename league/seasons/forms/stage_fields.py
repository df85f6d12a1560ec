"""The fields of a season's form for one stage: race types by turns, layout and rules."""

from collections.abc import Mapping
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from paddock.rules.race import BOTS_DRIVING, BOX_COUNT, DRAWN_BOXES, DUELS, RULES, STAGE, all_laps
from races.models.sensors import OFFERABLE
from races.rules.fields import rule_fields

from ...models import Stage
from ..services.season_plan import StagePlan, Turn

STAGES = (Stage.OPEN, Stage.PRO, Stage.FINALE, Stage.CHAMPIONSHIP)
TURNS = ("turn_1", "turn_2", "turn_3")
AS_PRO = "as_pro"  # what stands on the track as in the pro race of the month
LAYOUT = (*DRAWN_BOXES, *BOTS_DRIVING, *DUELS)
_CAMERA = ["FRONT_FACING_CAMERA"]


def _proposed(turns: tuple[str, ...], sensors: list[str], **rules: Any) -> dict[str, Any]:
    usual = {name: RULES[name].default_of_a_stage for name in (*STAGE, *LAYOUT)} | {"max_submissions": None}
    turns_by_name = dict(zip(TURNS, (*turns, "", ""), strict=False))
    return usual | turns_by_name | {"sensors": sensors} | rules


# As the official league's were in 2021 and 2022: newcomers drive alone with a camera, pros meet boxes and bots by turns
# with every sensor. A newcomer's car may leave the road; a finale asks for more.
PROPOSALS: dict[str, dict[str, Any]] = {
    Stage.OPEN: _proposed((Turn.TIME_TRIAL,), _CAMERA),
    Stage.PRO: _proposed((Turn.BOXES, Turn.BOTS), [*OFFERABLE], laps=5, off_track_penalty_ms=5000),
    Stage.FINALE: _proposed((AS_PRO,), [*OFFERABLE], **all_laps(3), off_track_penalty_ms=5000),
    Stage.CHAMPIONSHIP: _proposed((Turn.MODELS,), [*OFFERABLE], **all_laps(5), off_track_penalty_ms=5000),
}


def stage_fields(stage: Stage) -> dict[str, forms.Field]:
    """The fields of a stage by their names in the form, each with its proposal."""
    made = {**_turns(stage), **_layout(), **_rules()}
    for name, shown in made.items():
        shown.initial = PROPOSALS[stage][name]
        if name in STAGE or name in TURNS:
            shown.widget.attrs["aria-label"] = _("%(stage)s: %(field)s") % {"stage": stage.label, "field": shown.label}
    return {named(stage, name): shown for name, shown in made.items()}


def named(stage: Stage, name: str) -> str:
    return f"{stage.name.lower()}_{name}"


def stage_plan(stage: Stage, data: Mapping[str, Any]) -> StagePlan:
    own = {name: data[named(stage, name)] for name in (*TURNS, *LAYOUT, *STAGE, "sensors")}
    turns = [own[name] for name in TURNS if own[name]]
    return StagePlan(
        turns=() if turns == [AS_PRO] else turns,
        layout={name: RULES[name].default_of_a_stage if own[name] in (None, "") else own[name] for name in LAYOUT},
        sensors=own["sensors"],
        rules={name: own[name] for name in STAGE if own[name] is not None or RULES[name].optional},
    )


def _turns(stage: Stage) -> dict[str, forms.Field]:
    of_a_finale = stage in (Stage.FINALE, Stage.CHAMPIONSHIP)
    first = [(AS_PRO, _("same as the pro race")), *Turn.choices] if of_a_finale else Turn.choices
    again = [("", _("start again with the first race")), *Turn.choices]
    fields: dict[str, forms.Field] = {"turn_1": forms.ChoiceField(label=_("First race"), choices=first)}
    for name, label in (("turn_2", _("Second race")), ("turn_3", _("Third race"))):
        fields[name] = forms.ChoiceField(label=label, choices=again, required=False)
    if stage == Stage.CHAMPIONSHIP:
        fields["turn_1"].label = _("Race type")
        for name in TURNS[1:]:
            fields[name].widget = forms.HiddenInput()
    return fields


def _layout() -> dict[str, forms.Field]:
    """An empty one is as proposed."""
    fields = rule_fields(LAYOUT, strict=True)
    fields[BOX_COUNT].label = _("Boxes")
    fields[BOX_COUNT].help_text = _("Positions are drawn again each month.")
    return fields | rule_fields(("sensors",), strict=True)


def _rules() -> dict[str, forms.Field]:
    return rule_fields(STAGE, short=True, strict=True)

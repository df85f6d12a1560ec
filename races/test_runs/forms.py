"""The forms of a racer's own run: with custom rules, or as in a race."""

from collections.abc import Mapping
from types import new_class
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from evaluation.garage.selectors import cars_of
from evaluation.models import TrainedModel
from paddock.errors import UserFault
from paddock.rules.race import BOX_COUNT, MAX_CARS, MODELS, OF_SOME_TYPES, OWN_RULES, ROUND_ROBIN, RULES
from paddock.rules.ranked import NEEDED

from ..models import Race, RaceType
from ..models.rules import usual
from ..rules.fields import drop_rules_of_other_types, rule_field
from ..rules.layout_form import DRAWN, FIXED, PROPOSALS, LayoutForm, Preview, preview, show_refusal
from .selectors import usable_model, usable_rivals

RIVALS = tuple(f"rival_{number}" for number in range(1, MAX_CARS))
# The rules of every run, in rows of three on a page.
_IN_ROWS = tuple(
    sorted((name for name in OWN_RULES if name not in LayoutForm.base_fields), key=lambda name: OWN_RULES[name].place)
)
_FIELDS = {name: rule_field(OWN_RULES[name]) for name in _IN_ROWS}
_RuleFields = new_class("RuleFields", (LayoutForm,), exec_body=lambda body: body.update(_FIELDS))


class CarForm(forms.Form):
    """Which car drives."""

    model = forms.CharField(label=_("Model"), max_length=12, widget=forms.Select)

    def offer(self, cars: list[tuple[Any, Any]]) -> None:
        """The cars to choose from, as a select's choices."""
        self.fields["model"].widget.choices = [("", _("Choose a model")), *cars]

    def show(self, fault: UserFault) -> None:
        """Show a refusal, each problem beside its field where the form has it."""
        show_refusal(self, fault, _field_of(fault, self.fields))

    def place_error(self, field: str) -> str | None:
        """The field to show a problem at, None for the form as a whole."""
        return field if field in self.fields else None


class AsInForm(CarForm):
    """A run as in a race: all else is the race's."""

    submit_if_better = forms.BooleanField(
        label=_("Submit the car if the run beats my best result there"),
        help_text=_("Submitted once after the run. The race times it again, and it counts as a submission."),
        required=False,
    )

    def __init__(self, *args: Any, racer: Racer, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.offer(cars_of(racer, self["model"].value()))

    def service_arguments(self, racer: Racer) -> dict[str, Any]:
        """The chosen values as arguments of the service. Raises UserFault("own_model_gone")."""
        chosen = self.cleaned_data
        return {
            "model": usable_model(racer, chosen["model"]),
            "submit_if_better": chosen["submit_if_better"],
        }


class OwnForm(CarForm, _RuleFields):  # type: ignore[misc, valid-type]
    """A run with custom rules, which races.test_runs.rules checks."""

    # no effect here, but the check of a layout needs the format of duels
    duel_format = forms.CharField(initial=ROUND_ROBIN, required=False, widget=forms.HiddenInput)
    duel_cars = forms.IntegerField(initial=2, required=False, widget=forms.HiddenInput)

    def __init__(
        self, data: Any = None, *, racer: Racer | None = None, initial: Mapping[str, Any] | None = None
    ) -> None:
        super().__init__(data, initial={**_proposed(), **(initial or {})})
        cars = [] if racer is None else cars_of(racer, *(self[name].value() for name in self.fields if name == "model"))
        self.offer(cars)
        for number, name in enumerate(RIVALS, 1):
            label = _("Rival %(number)s") % {"number": number}
            self.fields[name] = forms.CharField(label=label, required=False, max_length=12, widget=forms.Select)
            self.fields[name].widget.choices = [("", _("none")), *cars]
        self.fields[NEEDED].required = False
        self.fields[NEEDED].widget.attrs["placeholder"] = str(RULES[NEEDED].default)

    def clean(self) -> dict[str, object]:
        """Rivals count in head-to-head against cars only; values of other types of race are dropped."""
        cleaned: dict[str, object] = super().clean() or {}
        drop_rules_of_other_types(self, cleaned)
        against_cars = cleaned.get("race_type") == RaceType.HEAD_TO_HEAD and cleaned.get("opponents") == MODELS
        cleaned |= {"duel_format": ROUND_ROBIN if against_cars else "", "duel_cars": 2}
        if not against_cars:
            cleaned |= dict.fromkeys(RIVALS, "")
        for name in _IN_ROWS:
            if name not in self.errors and cleaned.get(name) is None and name in RULES and name != NEEDED:
                cleaned[name] = usual(name)
        return cleaned

    def rows(self) -> list[list[forms.BoundField]]:
        """The rules that every run has, three to a row."""
        names = [name for name in _IN_ROWS if name not in OF_SOME_TYPES]
        return [[self[name] for name in names[at : at + 3]] for at in range(0, len(names), 3)]

    def rivals(self) -> list[forms.BoundField]:
        """The fields of the cars to race against."""
        return [self[name] for name in RIVALS]

    def service_arguments(self, racer: Racer) -> dict[str, Any]:
        """The chosen values as arguments of the service. Raises UserFault ``own_model_gone``, ``own_rival_gone``."""
        chosen = self.cleaned_data
        options = {name: chosen[name] for name in OWN_RULES if chosen.get(name) is not None}
        return {
            "model": usable_model(racer, chosen["model"]),
            "track": chosen["track"],
            "rivals": usable_rivals(racer, [chosen[name] for name in RIVALS if chosen[name]]),
            **options,
        }


def own_preview(form: OwnForm, *, submitted: bool) -> Preview:
    """The layout of the form's values, as in a race but without the text on its duels."""
    shown = preview(form, submitted=submitted)
    if shown.race is not None and shown.race.opponents == MODELS:
        shown.race.opponents, shown.race.duel_format = "", ""
    return shown


def values_of(options: Mapping[str, Any]) -> dict[str, object]:
    """Options of a run as initial values of its form."""
    values = dict(options)
    values["box_choice"] = DRAWN if values.get(BOX_COUNT) or not values.get("boxes") else FIXED
    return values | {name: proposal for name, proposal in PROPOSALS.items() if not values.get(name)}


def values_of_race(race: Race) -> dict[str, object]:
    """A race's track and rules as initial values of a run's form."""
    options = {name: getattr(race, name) for name in OWN_RULES if name in RULES}
    return values_of(options) | {"track": race.track.slug}


def values_of_rivals(models: list[TrainedModel]) -> dict[str, str]:
    """Rivals as initial values of a run's form."""
    return {name: model.public_id for name, model in zip(RIVALS, models, strict=False)}


def _proposed() -> dict[str, object]:
    usually = {name: usual(name) for name in OWN_RULES if name in RULES and name != NEEDED}
    return values_of(usually | {"start_m": 0.0}) | {"box_choice": FIXED}


def _field_of(fault: UserFault, fields: Mapping[str, Any]) -> str | None:
    number = fault.params.get("number")
    field = {"own_model_gone": "model", "own_rival_gone": f"rival_{number}", "own_needs_rivals": RIVALS[0]}.get(
        fault.code
    )
    return field if field in fields else None

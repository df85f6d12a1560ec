"""The part of the wizard that tries several settings instead of one."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from django import forms
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from accounts.models import Racer
from core.forms import add_fault
from paddock.errors import PlatformFault, UserFault
from paddock.packages.metadata import DISCRETE
from paddock.rules.hyperparameters import HYPERPARAMETERS, Hyperparameter
from paddock.rules.training import TrainingSettings, taken_from
from races.rules.form_fields import PlainNumberField

from ..jobs.settings_checks import SPEED_MPS, names_of
from ..models import Sweep
from ..models.sweep import SETTINGS_LEAST, SETTINGS_MOST, ActionSpaceChoice, SearchRange
from ..rewards.check_slots import refusals
from ..rewards.examples import EXAMPLES
from ..sweeps.services import SearchFields, create_sweep
from .fields import TRAINING, OwnRows
from .forms import TrainingForm
from .hyperparameters import SmallNumberField

# The proposed ends of each range; a hyperparameter with named choices has none, all of them are tried.
PROPOSED: dict[str, tuple[float, float]] = {
    "lr": (1e-4, 1e-3),
    "discount_factor": (0.95, 0.99),
    "batch_size": (32, 256),
    "num_epochs": (3, 8),
    "beta_entropy": (0.001, 0.05),
    "sac_alpha": (0.02, 0.2),
    "entropy_decay": (0.0, 1.0),
    "num_episodes_between_training": (5, 30),
}
SPEEDS = {
    "0.8": gettext_lazy("speeds × 0.8"),
    "1.25": gettext_lazy("speeds × 1.25"),
    "1.5": gettext_lazy("speeds × 1.5"),
}
_IN_ORDER = sorted(HYPERPARAMETERS.values(), key=lambda one: one.place)


class SweepForm(forms.Form):
    """What the settings differ in, how many there are, and the time that they share."""

    settings = forms.IntegerField(
        label=gettext_lazy("Settings to try"),
        min_value=SETTINGS_LEAST,
        max_value=SETTINGS_MOST,
        initial=6,
        help_text=gettext_lazy("2 to 12. The first has the values above."),
    )
    budget_minutes = PlainNumberField(
        label=gettext_lazy("Minutes for all together"),
        min_value=0.1,
        max_value=1440,
        initial=10,
        help_text=gettext_lazy("They replace the limits of step 7."),
    )
    vary = forms.MultipleChoiceField(
        label=gettext_lazy("Hyperparameters to vary"), required=False, widget=forms.CheckboxSelectMultiple
    )
    speeds = forms.MultipleChoiceField(
        label=gettext_lazy("Other action spaces"),
        choices=list(SPEEDS.items()),
        required=False,
        widget=forms.CheckboxSelectMultiple,
        help_text=gettext_lazy("The actions above with other speeds, from 0.1 to 4 m/s."),
    )
    rewards = forms.MultipleChoiceField(
        label=gettext_lazy("Other reward functions"), required=False, widget=forms.CheckboxSelectMultiple
    )

    def __init__(self, *args: Any, owner: Racer | None, read: OwnRows | None = None, **kwargs: Any) -> None:
        """``owner``: whose reward functions are offered, beside the examples."""
        super().__init__(*args, **{"prefix": "sweep", "initial": {"vary": ["lr"]}} | kwargs)
        fields: Any = self.fields
        fields["vary"].choices = [(one.name, _(one.label)) for one in _IN_ORDER]
        for name, ends in PROPOSED.items():
            for end, value in zip(("low", "high"), ends, strict=True):
                kind = forms.IntegerField if HYPERPARAMETERS[name].type is int else SmallNumberField
                self.fields[f"{name}_{end}"] = kind(required=False, initial=value)
        self._codes = {one.slug: one.code for one in EXAMPLES}
        own = [] if owner is None else (read or OwnRows(owner)).rows
        jobs = [(public_id, name, code) for kind, public_id, name, code, _at in own if kind == TRAINING]
        self._codes |= {public_id: code for public_id, _name, code in jobs}
        named = _("of my training %(name)s")
        fields["rewards"].choices = [
            *((one.slug, _(one.title)) for one in EXAMPLES),
            *((public_id, named % {"name": name}) for public_id, name, _code in jobs),
        ]

    def ranges(self) -> list[tuple[Hyperparameter, forms.BoundField | None, forms.BoundField | None, bool]]:
        """Each hyperparameter with the fields of its range, None where it has named choices; and whether it is
        ticked."""
        ticked = self["vary"].value() or []
        return [
            (
                one,
                *((self[f"{one.name}_low"], self[f"{one.name}_high"]) if one.name in PROPOSED else (None, None)),
                one.name in ticked,
            )
            for one in _IN_ORDER
        ]

    def reward_codes(self) -> list[str]:
        return [self._codes[name] for name in self.cleaned_data["rewards"]]

    def search(self, base: TrainingSettings) -> SearchFields:
        """What varies beside the base settings. Hyperparameters of the other algorithm are left out."""
        data, names = self.cleaned_data, names_of(base.algorithm)
        ranges: dict[str, SearchRange] = {}
        for name in data["vary"]:
            if name in names:
                choices = HYPERPARAMETERS[name].choices
                if choices:
                    ranges[name] = {"choices": list(choices)}
                else:
                    ranges[name] = {"low": data[f"{name}_low"], "high": data[f"{name}_high"]}
        spaces = [faster(base, float(factor)) for factor in data["speeds"]]
        return {"hyperparameters": ranges, "action_spaces": spaces, "reward_functions": self.reward_codes()}

    def show(self, fault: UserFault) -> None:
        name = str(fault.params.get("name", ""))
        places = {
            "sweep_budget": "budget_minutes",
            "training_minutes_left": "budget_minutes",
            "sweep_settings": "settings",
            "sweep_combinations": "settings",
            "sweep_space_empty": "vary",
            "sweep_variants": "rewards",
            "sweep_range": f"{name}_low",
            "training_hyperparameter": f"{name}_low",
            "training_batch_size": "batch_size_low",
        }
        place = places.get(fault.code)
        add_fault(self, fault, place if place in self.fields else None)


def faster(base: TrainingSettings, factor: float) -> ActionSpaceChoice:
    """The action space with all speeds times ``factor``, within what a car can do."""

    def scaled(speed: float) -> float:
        return round(min(max(speed * factor, SPEED_MPS[0]), SPEED_MPS[1]), 3)

    space: Any = base.action_space
    if base.action_space_type == DISCRETE:
        space = [{**action, "speed": scaled(action["speed"])} for action in space]
    else:
        space = {**space, "speed": {end: scaled(value) for end, value in space["speed"].items()}}
    return {"action_space_type": base.action_space_type, "action_space": space}


# Faults whose names do not say where they stand. The training's own hyperparameters are checked before.
_OF_TRAINING = ("sweep_name_form", "sweep_name_taken")
_OF_SWEEP = ("training_minutes_left", "training_hyperparameter", "training_batch_size")


def begin_sweep(form: TrainingForm, tried: SweepForm, owner: Racer, now: datetime) -> tuple[Sweep | None, int]:
    """The sweep, or None after what is wrong was put beside the fields of both forms; and the status."""

    def show(fault: UserFault) -> None:
        of_sweep = fault.code.startswith("sweep_") and fault.code not in _OF_TRAINING
        (tried if of_sweep or fault.code in _OF_SWEEP else form).show(fault)

    try:
        right = form.is_valid() & tried.is_valid()
        codes: Sequence[str] = tried.reward_codes() if "rewards" in tried.cleaned_data else ()
        if {"reward_code", "race_type"} <= set(form.cleaned_data):
            race_type = form.cleaned_data["race_type"]
            for fault in refusals(owner, form.cleaned_data["reward_code"], race_type):
                form.show(fault)
            for code in codes:
                for fault in refusals(owner, code, race_type):
                    add_fault(tried, fault, "rewards")
        if right and not form.errors and not tried.errors:
            asked, rest = taken_from(form.values())
            return create_sweep(
                owner=owner,
                settings=asked,
                count=tried.cleaned_data["settings"],
                budget_s=round(60 * tried.cleaned_data["budget_minutes"]),
                search=tried.search(asked),
                now=now,
                **rest,
            ), 302
    except UserFault as fault:
        show(fault)
    except PlatformFault as fault:
        add_fault(form, fault)
        return None, 503
    return None, 422

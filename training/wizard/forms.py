"""The form of the wizard; the service decides what a valid training is."""

from collections.abc import Iterable
from datetime import datetime
from types import new_class
from typing import Any

from django import forms
from django.core.exceptions import NON_FIELD_ERRORS
from django.utils.translation import gettext_lazy as _
from django.utils.translation import pgettext_lazy

from accounts.models import Racer
from core.forms import FieldsOnDemand, add_fault
from evaluation.models import TrainedModel
from paddock.errors import UserFault
from paddock.packages.metadata import CONTINUOUS, DISCRETE
from paddock.rules.race import BOX_COUNT, PROPOSED_BOTS, PROPOSED_BOXES, RULES, RaceRules
from paddock.rules.training import DRIVEN_BY, ENDING, MOST_TRACKS, RANDOMISED, SETTINGS
from races.entries.selectors.offers import enterable_now, likest_first
from races.models import Opponents, Race, RaceType
from races.rules.fields import rule_field
from races.rules.form_fields import PlainNumberField
from races.rules.layout_form import DRAWN, LayoutForm
from tracks.forms import TrackChoiceField
from tracks.models import Track
from tracks.selectors import shared_track, shared_tracks
from training.cloning.selectors import house_car_for, house_cars
from training.jobs.settings_checks import (
    DEFAULT_ACTIONS,
    DEFAULT_BOUNDS,
    REFUSALS,
    SPEED_GRANULARITIES,
    SPEED_MPS,
    STEERING_DEG,
    STEERING_GRANULARITIES,
    check_action_space,
)
from training.models import Algorithm, RewardSignature, Vehicle
from training.rewards.views import RewardCodeField

from .fields import ActionsField, CloneField, OfferedField, OwnRows, RaceField, RaceSelect, strength_field
from .hyperparameters import SHOWN, HyperparametersForm

RANGES = ("steering_low", "steering_high", "speed_low", "speed_high")
# What the ranges of a continuous action space may be put back to: the usual ones, or all that a car can do.
RESET_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "ranges": {
        "steering": (DEFAULT_BOUNDS["steering_angle"]["low"], DEFAULT_BOUNDS["steering_angle"]["high"]),
        "speed": (DEFAULT_BOUNDS["speed"]["low"], DEFAULT_BOUNDS["speed"]["high"]),
    },
    "bounds": {"steering": STEERING_DEG, "speed": SPEED_MPS},
}
FROM_HOUSE, FROM_NOTHING, FROM_MODEL = "house", "nothing", "model"
STARTS = {
    FROM_HOUSE: _("a house car that already drives"),
    FROM_NOTHING: _("nothing: a new network"),
    FROM_MODEL: _("another model"),
}
LAYOUT = tuple(name for name in DRIVEN_BY if RULES[name].layout)
# The steps of the wizard by the ids of their sections, each with its fields; every other field belongs to "how".
STEPS: dict[str, tuple[str, ...]] = {
    "what": ("name", "description", "start", "clone"),
    "where": (
        *("track", "direction", "race_type", "box_choice", "opponents", *LAYOUT),
        *("more_tracks", "alternate_direction", *RANDOMISED),
    ),
    "how": ("algorithm",),
    "actions": ("action_space_type", "actions", *RANGES),
    "vehicle": ("vehicle",),
    "reward": ("reward_code",),
    "stop": (*ENDING, "standing_laps", "submit_to_race", "evaluate_on"),
}


def _number(label: Any, least: float, most: float, step: float = 1, kind: type = PlainNumberField, **more: Any) -> Any:
    return kind(
        label=label,
        min_value=least,
        max_value=most,
        widget=forms.NumberInput(attrs={"min": least, "max": most, "step": step}),
        **more,
    )


_LAST = {name: rule_field(SETTINGS[name]) for name in (*ENDING, "alternate_direction")}
_LAST["standing_laps"] = rule_field(RULES["standing_laps"])
_LAST |= {name: strength_field(SETTINGS[name]) for name in RANDOMISED}
_Ending = new_class("Ending", (forms.Form,), exec_body=lambda body: body.update(_LAST))


class SettingsForm(HyperparametersForm, LayoutForm, _Ending):  # type: ignore[misc, valid-type]
    """What the wizard offers every racer alike. Values of choices not taken are dropped, whatever they are."""

    name = forms.RegexField(
        label=_("Name"),
        regex=r"^[A-Za-z0-9-]+\Z",
        max_length=64,
        help_text=_("1 to 64 English letters, digits and hyphens; no other model of yours may have it."),
        error_messages={"invalid": _("Use letters from a to z, digits and hyphens only.")},
        widget=forms.TextInput(
            attrs={
                "pattern": "[A-Za-z0-9\\-]+",
                "title": _("Use letters from a to z, digits and hyphens only."),
                "autocomplete": "off",
            }
        ),
    )
    description = forms.CharField(
        label=_("Description"),
        required=False,
        max_length=255,
        help_text=_("The purpose of this training, for later reference."),
    )
    more_tracks = forms.ModelMultipleChoiceField(
        label=_("More tracks"),
        queryset=Track.objects.exclude(length_m=None).defer("npy"),
        to_field_name="slug",
        required=False,
        help_text=_(
            "Each episode drives on one of all its tracks, drawn from the seed. Each evaluation drives on every one: "
            "the best is the best over all, and clean laps in a row must be driven on each. At most 8 tracks."
        ),
    )
    # only bots: models meet models in races
    opponents = forms.CharField(required=False, widget=forms.HiddenInput)
    algorithm = forms.ChoiceField(label=_("Algorithm"), choices=Algorithm.choices, widget=forms.RadioSelect)
    action_space_type = forms.ChoiceField(
        label=_("Action space"),
        choices=[(DISCRETE, _("a table of actions")), (CONTINUOUS, _("ranges (continuous)"))],
        widget=forms.RadioSelect,
    )
    steering_max = _number(_("Greatest steering angle (°)"), 1, STEERING_DEG[1], required=False)
    steering_granularity = forms.TypedChoiceField(
        label=_("Steering angles"), choices=[(n, n) for n in STEERING_GRANULARITIES], coerce=int, required=False
    )
    speed_max = _number(_("Greatest speed (m/s)"), *SPEED_MPS, 0.1, required=False)
    speed_granularity = forms.TypedChoiceField(
        label=_("Speeds"), choices=[(n, n) for n in SPEED_GRANULARITIES], coerce=int, required=False
    )
    actions = ActionsField(label=pgettext_lazy("of a car", "Actions"), required=False)
    steering_low = _number(_("Steering to the right (°)"), *STEERING_DEG, required=False)
    steering_high = _number(_("Steering to the left (°)"), *STEERING_DEG, required=False)
    speed_low = _number(_("Slowest (m/s)"), *SPEED_MPS, 0.1, required=False)
    speed_high = _number(_("Fastest (m/s)"), *SPEED_MPS, 0.1, required=False)
    reward_code = RewardCodeField(
        rows=18, error_messages={"required": _("Write a reward function, or take one of the examples.")}
    )
    evaluate_on = TrackChoiceField(
        label=_("Test drive when done"),
        empty_label=_("no"),
        required=False,
        help_text=_("Three private laps of the best model."),
    )

    def __init__(self, *args: Any, initial: dict[str, object] | None = None, **kwargs: Any) -> None:
        super().__init__(*args, initial={**INITIAL, **(initial or {})}, **kwargs)

    def ending_rows(self) -> list[list[forms.BoundField]]:
        return [[self[name] for name in ENDING[at : at + 3]] for at in range(0, len(ENDING), 3)]

    def offered_tracks(self) -> list[Track]:
        return sorted(shared_tracks(), key=lambda track: track.name)

    def ticked_tracks(self) -> list[str]:
        return [str(getattr(one, "slug", one)) for one in self["more_tracks"].value() or ()]

    def opens_more_tracks(self) -> bool:
        return bool(self.ticked_tracks() or self["more_tracks"].errors)

    def randomised_fields(self) -> list[forms.BoundField]:
        return [self[name] for name in RANDOMISED]

    def opens_randomisation(self) -> bool:
        return any(str(field.value() or 0) != "0" or field.errors for field in self.randomised_fields())

    def resets(self) -> list[tuple[str, str, str]]:
        """The buttons that reset ranges: submitted value, label, and the values of :data:`RANGES`."""
        labels = {"ranges": _("Default ranges"), "bounds": _("Full range")}
        return [
            (name, str(labels[name]), " ".join(f"{value:g}" for ends in ranges.values() for value in ends))
            for name, ranges in RESET_RANGES.items()
        ]

    def clean_more_tracks(self) -> list[Track]:
        more = [track for track in self.cleaned_data["more_tracks"] if track != self.cleaned_data.get("track")]
        if 1 + len(more) > MOST_TRACKS:
            raise forms.ValidationError(
                _("At most %(most)s tracks: untick some of these."), code="tracks", params={"most": MOST_TRACKS}
            )
        return more

    def clean(self) -> dict[str, object]:
        """Drop what belongs to choices not taken; check the action space, which is one value of several fields."""
        self.cleaned_data["opponents"] = ""
        if self.cleaned_data.get("race_type") == RaceType.HEAD_TO_HEAD:
            self.cleaned_data["opponents"] = Opponents.BOTS
        super().clean()
        cleaned = self.cleaned_data
        if cleaned.get("action_space_type") == CONTINUOUS:
            self.errors.pop("actions", None)
            own: tuple[str, ...] = RANGES
        else:
            for name in RANGES:
                self.errors.pop(name, None)
            own = ("actions",)
        if cleaned.get("algorithm") and cleaned.get("action_space_type") and not set(own) & set(self.errors):
            try:
                check_action_space(cleaned["algorithm"], cleaned["action_space_type"], self.action_space())
            except UserFault as fault:
                self.show(fault)
        return cleaned

    def action_space(self) -> Any:
        data = self.cleaned_data
        if data["action_space_type"] == DISCRETE:
            return data.get("actions") or []
        return {
            name: {end: data.get(f"{short}_{end}") for end in ("low", "high")}
            for name, short in (("steering_angle", "steering"), ("speed", "speed"))
        }

    def _foreign(self, cleaned: dict[str, object]) -> Iterable[str]:
        other_boxes = "boxes" if cleaned.get("box_choice") == DRAWN else BOX_COUNT
        names: dict[object, tuple[str, ...]] = {
            RaceType.OBJECT_AVOIDANCE: (other_boxes, "opponents", *_BOTS),
            RaceType.HEAD_TO_HEAD: ("boxes", BOX_COUNT),
        }
        return *names.get(cleaned.get("race_type"), (*LAYOUT, "opponents")), *_NEVER


class TrainingForm(SettingsForm):
    """Everything that a training is made of."""

    vehicle = OfferedField(
        label=_("Vehicle"),
        queryset=Vehicle.objects.none(),
        to_field_name="public_id",
        empty_label=_("The original car"),
        blank=True,  # offered among the others, first
        required=False,
        widget=forms.RadioSelect,
        error_messages={"invalid_choice": _("This vehicle is not in your garage. Choose one of yours.")},
    )
    start = forms.ChoiceField(label=_("Start from"), choices=STARTS, required=False, widget=forms.RadioSelect)
    clone = CloneField(
        label=pgettext_lazy("whose weights a training begins with", "Model"),
        help_text=_(
            "A model whose weights it begins with. It must have the same sensors, network and number of actions."
        ),
    )
    submit_to_race = RaceField(
        label=_("Submit to a race when done"),
        queryset=Race.objects.none(),
        to_field_name="slug",
        empty_label=_("no"),
        required=False,
        widget=RaceSelect,
        help_text=_("The best model is submitted automatically."),
    )

    def __init__(self, *args: Any, owner: Racer, now: datetime, read: OwnRows | None = None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        read = read or OwnRows(owner)
        self.fields["vehicle"].offered = read.vehicles
        if not house_cars():
            self.fields["start"].choices = [one for one in STARTS.items() if one[0] != FROM_HOUSE]
        self.fields["clone"].offer(read, self["clone"].value())
        self.fields["submit_to_race"].offered = likest_first(enterable_now(now, owner), self._driven_race())

    def _driven_race(self) -> Race:
        """The race that the training is like, as far as the form has it; similar races are offered first."""
        slug, direction, race_type = (str(self[name].value()) for name in ("track", "direction", "race_type"))
        track = shared_track(slug)
        return Race(track_id=0 if track is None else track.pk, direction=direction, race_type=race_type)

    @property
    def wrong_steps(self) -> set[str]:
        step_of = {name: step for step, names in STEPS.items() for name in names}
        return {step_of.get(name, "how") for name in self.errors if name != NON_FIELD_ERRORS}

    def clean(self) -> dict[str, object]:
        """A model to start from counts only where one is to be chosen."""
        super().clean()
        cleaned = self.cleaned_data
        cleaned["start"] = cleaned.get("start") or (FROM_MODEL if cleaned.get("clone") else FROM_NOTHING)
        if cleaned["start"] != FROM_MODEL:
            self.errors.pop("clone", None)
        elif not cleaned.get("clone") and "clone" not in self.errors:
            self.add_error("clone", _("Choose a model, or start from nothing."))
        return cleaned

    def values(self) -> dict[str, object]:
        """The form's values as :func:`paddock.rules.training.taken_from` takes them."""
        data = self.cleaned_data
        own = ("name", "description", "track", *DRIVEN_BY, *ENDING, "algorithm", "vehicle", "reward_code")
        return {
            **{name: data[name] for name in (*own, "more_tracks", "alternate_direction")},
            **{name: data[name] or 0 for name in RANDOMISED},
            "seed": data["seed"] if str(self.data.get("seed", "")).strip() else None,  # None: another one each time
            "hyperparameters": self.hyperparameters(),
            "action_space_type": data["action_space_type"],
            "action_space": self.action_space(),
            "reward_signature": RewardSignature.of(data["reward_code"]),
            "clone_from": self.starting_model(),
            "submit_to_race": data["submit_to_race"],
            "evaluate_on": data["evaluate_on"],
        }

    def starting_model(self) -> TrainedModel | None:
        """The model whose weights the training begins with; None: a new network."""
        data = self.cleaned_data
        if data["start"] == FROM_HOUSE:
            vehicle = data["vehicle"] or Vehicle()
            return house_car_for(vehicle, data["algorithm"], data["action_space_type"], self.action_space())
        return data["clone"] if data["start"] == FROM_MODEL else None

    def show(self, fault: UserFault) -> None:
        add_fault(self, fault, self.place_of(fault))

    def place_of(self, fault: UserFault) -> str | None:
        if fault.code.startswith("reward_"):
            return "reward_code"
        if fault.code.startswith("clone_"):
            return "clone"
        if fault.code in ("training_action_value", "training_range_value", "training_action_bounds"):
            short = "speed" if named_in(fault) == "speed" else "steering"
            end = "low" if fault.params.get("where") == "low" else "high"
            return "actions" if self.cleaned_data.get("action_space_type") == DISCRETE else f"{short}_{end}"
        if fault.code in ("training_hyperparameter", "training_randomisation"):
            return named_in(fault)
        if fault.code in LAYOUT_CODES:
            boxes = BOX_COUNT if self.cleaned_data.get("box_choice") == DRAWN else "boxes"
            return {RaceType.OBJECT_AVOIDANCE: boxes, RaceType.HEAD_TO_HEAD: "bots"}.get(
                self.cleaned_data.get("race_type"), "race_type"
            )
        return PLACES.get(fault.code)


TrainingForm.base_fields = FieldsOnDemand(TrainingForm.base_fields)


def named_in(fault: UserFault) -> str:
    return str(fault.params.get("name", ""))


# What is wrong with what stands or drives on the track.
LAYOUT_CODES = (
    *("training_course", "bots_do_not_fit", "boxes_do_not_fit", "boxes_overlap", "box_on_start_line", "box_off_track"),
)
PLACES = {
    "training_tracks": "more_tracks",
    "training_name_form": "name",
    "training_name_taken": "name",
    "sweep_name_form": "name",
    "sweep_name_taken": "name",
    "training_algorithm": "algorithm",
    "training_loss_type": "loss_type",
    "training_batch_size": "batch_size",
    "training_sac_continuous": "action_space_type",
    "training_action_count": "actions",
    **{code: name for name, code in REFUSALS.items()},
    "training_minutes_left": "stop_minutes",
    "training_reward_missing": "reward_code",
    "training_evaluate_on": "evaluate_on",
    "sensors_not_offered": "submit_to_race",
    "race_closed": "submit_to_race",
    "race_cancelled": "submit_to_race",
}
_NEVER = tuple(name for name, rule in RULES.items() if rule.layout and name not in (*DRIVEN_BY, "opponents"))
_BOTS = tuple(name for name in LAYOUT if name.startswith("bot"))
GRANULARITIES = {"steering_max": 30.0, "steering_granularity": 5, "speed_max": 1.4, "speed_granularity": 1}
INITIAL: dict[str, object] = {
    "track": "oval",
    "direction": "ccw",
    "race_type": RaceType.TIME_TRIAL,
    "box_choice": DRAWN,
    BOX_COUNT: PROPOSED_BOXES,
    "opponents": Opponents.BOTS,
    "bots": PROPOSED_BOTS,
    **{name: getattr(RaceRules, name) for name in (*_BOTS, "standing_laps") if name != "bots"},
    "algorithm": Algorithm.PPO,
    "action_space_type": DISCRETE,
    **GRANULARITIES,
    **dict(zip(RANGES, (value for ends in RESET_RANGES["ranges"].values() for value in ends), strict=True)),
    "actions": [dict(action) for action in DEFAULT_ACTIONS],
    **{name: SETTINGS[name].default for name in (*ENDING, "alternate_direction", *RANDOMISED)},
    **SHOWN,
}

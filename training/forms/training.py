"""The wizard "Create a model" as one form. What a training may be is decided by its service, not here."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from types import new_class
from typing import TYPE_CHECKING, Any

from django import forms
from django.core.exceptions import NON_FIELD_ERRORS
from django.utils.translation import gettext_lazy as _
from django.utils.translation import pgettext_lazy

from core.forms import add_fault
from paddock.errors import UserFault
from paddock.rules.race import PROPOSED_BOTS, PROPOSED_BOXES, RULES, RaceRules
from paddock.rules.training import DRIVEN_BY, ENDING, MOST_TRACKS, RANDOMISED, SETTINGS
from races.fields import PlainNumberField
from races.layout_form import DRAWN, LayoutForm
from races.models import Opponents, Race, RaceType
from races.names import named, names_track
from races.rules.fields import rule_field
from races.selectors.offers import enterable_now, likest_first
from tracks.models import Track
from training.actions import (
    SPEED_GRANULARITIES,
    STEERING_GRANULARITIES,
    discrete_actions,
)
from training.hyperparameters import (
    DEFAULT_ACTIONS,
    DEFAULT_BOUNDS,
    REFUSALS,
    SPEED_MPS,
    STEERING_DEG,
    check_action_space,
)
from training.models import Algorithm, RewardSignature, Vehicle
from training.vehicles import vehicles_of

from .clone import CloneField
from .fields import ActionsField, strength_field
from .hyperparameters import SHOWN, HyperparametersForm

if TYPE_CHECKING:
    from accounts.models import Racer

DISCRETE, CONTINUOUS = "discrete", "continuous"
_COMMAS_OF_2018 = 11  # its twelve arguments: rewards.function.POSITIONAL_NAMES, which brings the physics along
_ARGUMENTS = re.compile(r"^def[ \t]+reward_function[ \t]*\(([^)]*)\)", re.MULTILINE)
RANGES = ("steering_low", "steering_high", "speed_low", "speed_high")
# What the ranges of a continuous action space may be put back to: the usual ones, or all that a car can do.
RESET_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "ranges": {
        "steering": (DEFAULT_BOUNDS["steering_angle"]["low"], DEFAULT_BOUNDS["steering_angle"]["high"]),
        "speed": (DEFAULT_BOUNDS["speed"]["low"], DEFAULT_BOUNDS["speed"]["high"]),
    },
    "bounds": {"steering": STEERING_DEG, "speed": SPEED_MPS},
}
LAYOUT = tuple(name for name in DRIVEN_BY if RULES[name].layout)
# The steps of the wizard by the ids of their sections, each with its fields; every other field belongs to "how".
STEPS: dict[str, tuple[str, ...]] = {
    "what": ("name", "description", "clone"),
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


@dataclass(frozen=True)
class DrivenTrack:
    """Where a training drives."""

    track_id: int
    direction: str
    race_type: str


class RaceSelect(forms.Select):
    """Races, each with where it drives: the script of the page puts those first that are like the training."""

    def create_option(self, name: str, value: Any, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """As Django's, with ``data-drives``: track, race type and direction."""
        option = super().create_option(name, value, *args, **kwargs)
        race = getattr(value, "instance", None)
        if race is not None:
            option["attrs"]["data-drives"] = f"{race.track.slug} {race.race_type} {race.direction}"
        return option


_LAST = {name: rule_field(SETTINGS[name]) for name in (*ENDING, "alternate_direction")}
_LAST["standing_laps"] = rule_field(RULES["standing_laps"])
_LAST |= {name: strength_field(SETTINGS[name]) for name in RANDOMISED}
_Ending = new_class("Ending", (forms.Form,), exec_body=lambda body: body.update(_LAST))


class TrainingForm(HyperparametersForm, LayoutForm, _Ending):  # type: ignore[misc, valid-type]
    """Everything that a training is made of. Values of choices not taken are dropped, whatever they are."""

    name = forms.RegexField(
        label=_("Name"),
        regex=r"^[A-Za-z0-9-]+\Z",
        max_length=64,
        help_text=_("1 to 64 letters, digits and hyphens; no other model of yours may have it."),
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
        queryset=Track.objects.none(),
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
    vehicle = forms.ModelChoiceField(
        label=_("Vehicle"),
        queryset=Vehicle.objects.none(),
        to_field_name="public_id",
        empty_label=_("The original car"),
        blank=True,  # offered among the others, first
        required=False,
        widget=forms.RadioSelect,
        error_messages={"invalid_choice": _("This vehicle is not in your garage. Choose one of yours.")},
    )
    clone = CloneField(
        label=_("Start from"),
        help_text=_(
            "A model whose weights it begins with. It must have the same sensors, network and number of actions."
        ),
    )
    reward_code = forms.CharField(
        label=_("Reward function"),
        strip=False,
        widget=forms.Textarea(attrs={"rows": 18, "spellcheck": "false", "autocapitalize": "off", "class": "code"}),
        error_messages={"required": _("Write a reward function, or take one of the examples.")},
    )
    submit_to_race = forms.ModelChoiceField(
        label=_("Submit to a race when done"),
        queryset=Race.objects.none(),
        to_field_name="slug",
        empty_label=_("no"),
        required=False,
        widget=RaceSelect,
        help_text=_("The best model is submitted automatically."),
    )
    evaluate_on = forms.ModelChoiceField(
        label=_("Test drive when done"),
        queryset=Track.objects.none(),
        to_field_name="slug",
        empty_label=_("no"),
        required=False,
        help_text=_("Three private laps of the best model."),
    )

    def __init__(
        self, *args: Any, owner: Racer, now: datetime, initial: dict[str, Any] | None = None, **kwargs: Any
    ) -> None:
        super().__init__(*args, initial={**INITIAL, **(initial or {})}, **kwargs)
        self.fields["more_tracks"].queryset = Track.objects.exclude(length_m=None).order_by("name")
        self.fields["vehicle"].queryset = vehicles_of(owner)
        self.fields["vehicle"].label_from_instance = lambda vehicle: vehicle.name
        self.fields["clone"].offer(owner, self["clone"].value())
        self.fields["evaluate_on"].queryset = Track.objects.exclude(length_m=None).defer("npy")
        self.fields["submit_to_race"].queryset = likest_first(enterable_now(now, owner), self._driven_track())
        self.fields["submit_to_race"].label_from_instance = lambda race: (
            named(race.name) if names_track(race.name, race.track.name) else f"{named(race.name)} · {race.track.name}"
        )

    def _driven_track(self) -> DrivenTrack:
        """Where it will learn, as far as the form says: races like that are offered first."""
        slug, direction, race_type = (str(self[name].value()) for name in ("track", "direction", "race_type"))
        return DrivenTrack(
            Track.objects.filter(slug=slug).values_list("pk", flat=True).first() or 0, direction, race_type
        )

    def ending_rows(self) -> list[list[forms.BoundField]]:
        """When it ends and what is the best of it, three to a row."""
        return [[self[name] for name in ENDING[at : at + 3]] for at in range(0, len(ENDING), 3)]

    def track_choices(self) -> list[Track]:
        """All tracks, to be ticked."""
        return list(self.fields["more_tracks"].queryset)

    def ticked_tracks(self) -> list[str]:
        """Slugs of those that are."""
        return [str(getattr(one, "slug", one)) for one in self["more_tracks"].value() or ()]

    def opens_more_tracks(self) -> bool:
        """Whether there is something to see among more tracks."""
        return bool(self.ticked_tracks() or self["more_tracks"].errors)

    def randomised_fields(self) -> list[forms.BoundField]:
        """What episodes may draw anew."""
        return [self[name] for name in RANDOMISED]

    def opens_randomisation(self) -> bool:
        """Whether something of it is ticked, or wrong."""
        return any(str(field.value() or 0) != "0" or field.errors for field in self.randomised_fields())

    def resets(self) -> list[tuple[str, str, str]]:
        """The buttons that put ranges back: what each says to the server, its label, the values of :data:`RANGES`."""
        labels = {"ranges": _("Default ranges"), "bounds": _("Full range")}
        return [
            (name, str(labels[name]), " ".join(f"{value:g}" for ends in ranges.values() for value in ends))
            for name, ranges in RESET_RANGES.items()
        ]

    @property
    def wrong_steps(self) -> set[str]:
        """The steps of the wizard in which something is to be corrected."""
        step_of = {name: step for step, names in STEPS.items() for name in names}
        return {step_of.get(name, "how") for name in self.errors if name != NON_FIELD_ERRORS}

    def clean_more_tracks(self) -> list[Track]:
        """Those beside the first one, which may be ticked too."""
        more = [track for track in self.cleaned_data["more_tracks"] if track != self.cleaned_data.get("track")]
        if 1 + len(more) > MOST_TRACKS:
            raise forms.ValidationError(
                _("At most %(most)s tracks: untick some of these."), code="tracks", params={"most": MOST_TRACKS}
            )
        return more

    def clean_reward_code(self) -> str:
        """The text with line ends as Python counts them; forms send CR LF."""
        return self.cleaned_data["reward_code"].replace("\r\n", "\n")

    def clean(self) -> dict[str, Any]:
        """Drop what belongs to choices not taken; check the action space, which is one value of several fields."""
        self.cleaned_data["opponents"] = ""
        if self.cleaned_data.get("race_type") == RaceType.HEAD_TO_HEAD:
            self.cleaned_data["opponents"] = Opponents.BOTS
        cleaned = super().clean()
        if cleaned.get("action_space_type") == CONTINUOUS:
            self.errors.pop("actions", None)
            own: tuple[str, ...] = RANGES
        else:
            for name in RANGES:
                self.errors.pop(name, None)
            own = ("actions",)
        if cleaned.get("algorithm") and cleaned.get("action_space_type") and not set(own) & set(self.errors):
            try:
                check_action_space(cleaned["algorithm"], cleaned["action_space_type"], self.action_space(cleaned))
            except UserFault as fault:
                self.show(fault)
        return cleaned

    def action_space(self, said: dict[str, Any]) -> Any:
        """The action space as ``model_metadata.json`` has it."""
        if said["action_space_type"] == DISCRETE:
            return said.get("actions") or []
        return {
            name: {end: said.get(f"{short}_{end}") for end in ("low", "high")}
            for name, short in (("steering_angle", "steering"), ("speed", "speed"))
        }

    def _foreign(self, cleaned: dict[str, Any]) -> Iterable[str]:
        other_boxes = "boxes" if cleaned.get("box_choice") == DRAWN else "random_boxes"
        names: dict[str | None, tuple[str, ...]] = {
            RaceType.OBJECT_AVOIDANCE: (other_boxes, "opponents", *_BOTS),
            RaceType.HEAD_TO_HEAD: ("boxes", "random_boxes"),
        }
        return *names.get(cleaned.get("race_type"), (*LAYOUT, "opponents")), *_NEVER

    def make_table(self) -> list[dict[str, float]]:
        """The table of actions that the granularities on the form make, usual ones in place of nonsense."""
        values = {name: self.cleaned_data.get(name) or INITIAL[name] for name in GRANULARITIES}
        return discrete_actions(*values.values())

    def values(self) -> dict[str, Any]:
        """What the form says, as :func:`paddock.rules.training.taken_from` takes it."""
        said = self.cleaned_data
        own = ("name", "description", "track", *DRIVEN_BY, *ENDING, "algorithm", "vehicle", "reward_code")
        return {
            **{name: said[name] for name in (*own, "more_tracks", "alternate_direction")},
            **{name: said[name] or 0 for name in RANDOMISED},
            "seed": said["seed"] if str(self.data.get("seed", "")).strip() else None,  # None: another one each time
            "hyperparameters": self.hyperparameters(),
            "action_space_type": said["action_space_type"],
            "action_space": self.action_space(said),
            "reward_signature": signature_of(said["reward_code"]),
            "clone_from": said["clone"],
            "submit_to_race": said["submit_to_race"],
            "evaluate_on": said["evaluate_on"],
        }

    def show(self, fault: UserFault) -> None:
        """Show a refusal of the service beside the field that it is about."""
        add_fault(self, fault, self.place_of(fault))

    def place_of(self, fault: UserFault) -> str | None:
        """The field that a refusal is about, None for the training as a whole."""
        if fault.code.startswith("reward_"):
            return "reward_code"
        if fault.code in ("training_action_value", "training_range_value", "training_action_bounds"):
            short = "speed" if named_in(fault) == "speed" else "steering"
            end = "low" if fault.params.get("where") == "low" else "high"
            return "actions" if self.cleaned_data.get("action_space_type") == DISCRETE else f"{short}_{end}"
        if fault.code in ("training_hyperparameter", "training_randomisation"):
            return named_in(fault)
        if fault.code in LAYOUT_CODES:
            boxes = "random_boxes" if self.cleaned_data.get("box_choice") == DRAWN else "boxes"
            return {RaceType.OBJECT_AVOIDANCE: boxes, RaceType.HEAD_TO_HEAD: "bots"}.get(
                self.cleaned_data.get("race_type"), "race_type"
            )
        return PLACES.get(fault.code)


def signature_of(code: str) -> str:
    """Which of the two forms a reward function has, by the commas among its arguments; today's form if that cannot be
    told. It is not parsed: so much text can keep the parser busy for ten seconds, which only the sandbox can bear."""
    found = _ARGUMENTS.search(code)
    commas = found[1].count(",") if found else 0
    return RewardSignature.POSITIONAL if commas >= _COMMAS_OF_2018 else RewardSignature.PARAMS


def named_in(fault: UserFault) -> str:
    """What a refusal names."""
    return str(fault.params.get("name", ""))


# What is wrong with what stands or drives on the track.
LAYOUT_CODES = (
    *("training_course", "bots_do_not_fit", "boxes_do_not_fit", "boxes_overlap", "box_on_start_line", "box_off_track"),
)
PLACES = {
    "training_tracks": "more_tracks",
    "training_name_form": "name",
    "training_name_taken": "name",
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
    "clone_not_yours": "clone",
    "clone_sensors": "clone",
    "clone_network": "clone",
    "clone_actions": "clone",
    "clone_not_ours": "clone",
}
_NEVER = ("box_distance_m", "duel_format", "duel_cars", "duel_gap_m", "duel_heats", "duels_live_only")
_BOTS = tuple(name for name in LAYOUT if name.startswith("bot"))
GRANULARITIES = ("steering_max", "steering_granularity", "speed_max", "speed_granularity")
INITIAL: dict[str, Any] = {
    "track": "oval",
    "direction": "ccw",
    "race_type": RaceType.TIME_TRIAL,
    "box_choice": DRAWN,
    "random_boxes": PROPOSED_BOXES,
    "opponents": Opponents.BOTS,
    "bots": PROPOSED_BOTS,
    **{name: getattr(RaceRules, name) for name in (*_BOTS, "standing_laps") if name != "bots"},
    "algorithm": Algorithm.PPO,
    "action_space_type": DISCRETE,
    "steering_max": 30.0,
    "steering_granularity": 5,
    "speed_max": 1.4,
    "speed_granularity": 1,
    "steering_low": DEFAULT_BOUNDS["steering_angle"]["low"],
    "steering_high": DEFAULT_BOUNDS["steering_angle"]["high"],
    "speed_low": DEFAULT_BOUNDS["speed"]["low"],
    "speed_high": DEFAULT_BOUNDS["speed"]["high"],
    "actions": [dict(action) for action in DEFAULT_ACTIONS],
    **{name: SETTINGS[name].default for name in (*ENDING, "alternate_direction", *RANDOMISED)},
    **SHOWN,
}

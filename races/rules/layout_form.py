"""The part of a race's form for boxes and bots on the track, and its preview."""

from collections.abc import Iterable
from dataclasses import dataclass
from types import new_class
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from paddock.errors import UserFault
from paddock.rules.race import BOX_COUNT, BOX_RULES, DRAWN_BOXES, LAYOUT, MAX_BOXES, RULES
from tracks.drawing.maps import BoxMark
from tracks.forms import TrackChoiceField, label_directions
from tracks.selectors import shared_track

from ..errors import RaceRefused
from ..models import Opponents, Race, RaceType
from ..models.layout import problems_of
from ..models.rules import usual
from .fields import rule_fields
from .layout import box_marks, check_layout, typed_boxes

FIXED, DRAWN = "fixed", "drawn"
_BOTS = tuple(name for name in LAYOUT if name.startswith("bot"))
_DUELS = tuple(name for name in LAYOUT if name.startswith("duel"))
# Initial values of a form for a race without a layout.
PROPOSALS = {name: rule.proposed for name, rule in RULES.items() if rule.proposed is not None}
_FIELDS = rule_fields(("direction", "race_type", *LAYOUT, "seed"))
_RuleFields = new_class("RuleFields", (forms.Form,), exec_body=lambda body: body.update(_FIELDS))


class LayoutForm(_RuleFields):  # type: ignore[misc, valid-type]
    """Track, type of race and the rules of that type. Values of other types are dropped unchecked."""

    track = TrackChoiceField(label=_("Track"), empty_label=_("Choose a track"))
    box_choice = forms.ChoiceField(
        label=_("Box positions"),
        choices=[(FIXED, _("in the positions I choose")), (DRAWN, _("drawn from the seed"))],
        widget=forms.RadioSelect,
        required=False,
    )

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["track"].label_from_instance = lambda track: f"{track.name} · {track.length_m:.2f} m"
        label_directions(self)

    def clean(self) -> dict[str, object]:
        """Drop values of other race types, bad ones too, and replace empty ones by their defaults."""
        cleaned = super().clean()
        for name in self._foreign(cleaned):
            self.errors.pop(name, None)
            cleaned[name] = usual(name)
        for name in (*LAYOUT, "seed"):
            if name not in self.errors and cleaned.get(name) is None:
                cleaned[name] = usual(name)
        return cleaned

    def place_error(self, field: str) -> str | None:
        """The form field to show a race's problem with ``field`` at, None for the form as a whole."""
        if field == "boxes" and self.cleaned_data.get("box_choice") == DRAWN:
            return BOX_COUNT
        return field if field in self.fields else None

    def _foreign(self, cleaned: dict[str, object]) -> Iterable[str]:
        race_type = cleaned.get("race_type")
        if race_type == RaceType.OBJECT_AVOIDANCE:
            other_boxes = ("boxes",) if cleaned.get("box_choice") == DRAWN else DRAWN_BOXES
            return (*other_boxes, "opponents", *_BOTS, *_DUELS)
        if race_type == RaceType.HEAD_TO_HEAD:
            others: dict[object, tuple[str, ...]] = {Opponents.BOTS: _DUELS, Opponents.MODELS: _BOTS}
            return (*BOX_RULES, *others.get(cleaned.get("opponents"), (*_BOTS, *_DUELS)))
        return LAYOUT


def show_refusal(form: Any, fault: UserFault, field: str | None = None) -> None:
    """Show a refusal on a form, each problem of a race beside its field where the form has it, others at ``field``."""
    if isinstance(fault, RaceRefused) and hasattr(fault.errors, "error_dict"):
        for name, errors in fault.errors.error_dict.items():
            form.add_error(form.place_error(name), errors)
    else:
        add_fault(form, fault, field)


@dataclass(frozen=True)
class Preview:
    """The preview of a form's layout. ``race``: unsaved, None without a track; ``problems``: why it cannot be driven
    so, a sentence each; ``boxes``: where they stand, in the order driven; as long as there are problems those in fixed
    places only, in the order typed, the wrong ones marked; ``hint``: the missing input, no problem before
    the form is sent."""

    race: Race | None
    problems: list[str]
    boxes: tuple[BoxMark, ...]
    hint: str = ""


def preview(form: LayoutForm, *, submitted: bool) -> Preview:
    """The layout of a form's values, or of its initial values. Missing boxes are a problem once it is ``submitted``."""
    if form.is_bound:
        form.is_valid()
        values = {name: form.cleaned_data[name] for name in _DRAWN_BY if name in form.cleaned_data}
    else:
        values = {name: form.get_initial_for_field(form.fields[name], name) for name in _DRAWN_BY}
        if isinstance(values["track"], str):
            values["track"] = shared_track(values["track"])
        foreign = form._foreign(values | {"box_choice": form.initial.get("box_choice")})
        values |= {name: usual(name) for name in foreign}
        values = {name: _meant(form, name, value) for name, value in values.items()}
    if values.get("track") is None:
        return Preview(None, [], ())
    race = Race(**values)
    problems: dict[str, list[ValidationError]] = ValidationError(problems_of(race)).error_dict
    if not problems:
        try:
            check_layout(race)
        except ValidationError as error:
            problems = error.error_dict
    own = {name: form.errors[name].as_data()[:1] for name in LAYOUT if form.is_bound and name in form.errors}
    if not own and not submitted and _waits_for_boxes(form, problems):
        hint = _("No boxes yet. Place 1 to %(most)s on the track, or let the seed place them.")
        return Preview(race, [], (), hint % {"most": MAX_BOXES})
    shown = own or problems
    sentences = list(dict.fromkeys(text for errors in shown.values() for error in errors for text in error.messages))
    if not sentences:
        return Preview(race, [], box_marks(race, numbered=True))
    if race.race_type != RaceType.OBJECT_AVOIDANCE or race.random_boxes:
        return Preview(race, sentences, ())
    typed = form["boxes"].value() if form.is_bound else values["boxes"]
    boxes, all_of_them = typed_boxes(race, form.fields["boxes"].each(typed))
    return Preview(race, list(dict.fromkeys([*sentences, *all_of_them])), boxes)


def _waits_for_boxes(form: LayoutForm, problems: dict[str, list[ValidationError]]) -> bool:
    """Whether the only problem is a missing box and the field for the number of boxes is empty."""
    codes = [error.code for errors in problems.values() for error in errors]
    typed = form[BOX_COUNT].value() if form["box_choice"].value() == DRAWN else None
    return codes == ["race_needs_boxes"] and typed in (None, "")


def _meant(form: LayoutForm, name: str, value: Any) -> Any:
    """An initial value as the layout takes it: an address may fill in any text, or none."""
    if name in ("track", "boxes") or not (value is None or isinstance(value, str)):
        return value
    try:
        cleaned = form.fields[name].clean(value)
    except ValidationError:
        return usual(name)
    return usual(name) if cleaned is None else cleaned


_DRAWN_BY = ("track", "direction", "race_type", *LAYOUT, "seed")

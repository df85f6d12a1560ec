"""The part of a race's form that says what stands and drives on the track, and the preview of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import new_class
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from paddock.rules.race import LAYOUT, MAX_BOXES, RULES
from tracks.drawing import BoxMark
from tracks.models import Track
from tracks.ways import say_ways

from .layout import box_marks, check_layout, typed_boxes
from .models import Opponents, Race, RaceType
from .models.layout import problems_of
from .models.rules import usual
from .rules.fields import rule_fields

FIXED, DRAWN = "fixed", "drawn"
_BOXES = ("boxes", "random_boxes", "box_distance_m")
_BOTS = tuple(name for name in LAYOUT if name.startswith("bot"))
_DUELS = tuple(name for name in LAYOUT if name.startswith("duel"))
# What a form proposes for a race that has none of it yet.
PROPOSALS = {name: rule.proposed for name, rule in RULES.items() if rule.proposed is not None}
_FIELDS = rule_fields(("direction", "race_type", *LAYOUT, "seed"))
_RuleFields = new_class("RuleFields", (forms.Form,), exec_body=lambda body: body.update(_FIELDS))


class LayoutForm(_RuleFields):  # type: ignore[misc, valid-type]
    """Track, type of race, and what belongs to that type. Values of other types are dropped, whatever they are."""

    track = forms.ModelChoiceField(
        label=_("Track"), queryset=Track.objects.none(), to_field_name="slug", empty_label=_("Choose a track")
    )
    box_choice = forms.ChoiceField(
        label=_("Box positions"),
        choices=[(FIXED, _("in the positions I choose")), (DRAWN, _("drawn from the seed"))],
        widget=forms.RadioSelect,
        required=False,
    )

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["track"].queryset = Track.objects.exclude(length_m=None).defer("npy")
        self.fields["track"].label_from_instance = lambda track: f"{track.name} · {track.length_m:.2f} m"
        say_ways(self)

    def clean(self) -> dict[str, Any]:
        """Drop what does not belong to the type of race, bad values too, and take the usual value for an empty one."""
        cleaned = super().clean()
        for name in self._foreign(cleaned):
            self.errors.pop(name, None)
            cleaned[name] = usual(name)
        for name in (*LAYOUT, "seed"):
            if name not in self.errors and cleaned.get(name) is None:
                cleaned[name] = usual(name)
        return cleaned

    def place_error(self, field: str) -> str | None:
        """The field of this form beside which a race's problem with ``field`` is told, None for the form as a whole."""
        if field == "boxes" and self.cleaned_data.get("box_choice") == DRAWN:
            return "random_boxes"
        return field if field in self.fields else None

    def _foreign(self, cleaned: dict[str, Any]) -> Iterable[str]:
        race_type = cleaned.get("race_type")
        if race_type == RaceType.OBJECT_AVOIDANCE:
            other_boxes = ("boxes",) if cleaned.get("box_choice") == DRAWN else ("random_boxes", "box_distance_m")
            return (*other_boxes, "opponents", *_BOTS, *_DUELS)
        if race_type == RaceType.HEAD_TO_HEAD:
            others: dict[str | None, tuple[str, ...]] = {Opponents.BOTS: _DUELS, Opponents.MODELS: _BOTS}
            return (*_BOXES, *others.get(cleaned.get("opponents"), (*_BOTS, *_DUELS)))
        return LAYOUT


@dataclass(frozen=True)
class Preview:
    """What a form's layout looks like. ``race``: unsaved, None without a track; ``problems``: why it cannot be driven
    so, a sentence each; ``boxes``: where they stand, in the order driven; as long as there are problems those in fixed
    places only, in the order typed, the wrong ones marked; ``hint``: what is still to be filled in, which is not a
    problem before the form is sent."""

    race: Race | None
    problems: list[str]
    boxes: tuple[BoxMark, ...]
    hint: str = ""


def preview(form: LayoutForm, *, submitted: bool) -> Preview:
    """The layout that a form says now: of what was typed if it is bound, else of its initial values.

    ``submitted``: whether the form was sent to be saved. Before that, boxes that nobody has placed yet are no problem.
    """
    if form.is_bound:
        form.is_valid()
        values = {name: form.cleaned_data[name] for name in _DRAWN_BY if name in form.cleaned_data}
    else:
        values = {name: form.get_initial_for_field(form.fields[name], name) for name in _DRAWN_BY}
        if isinstance(values["track"], str):
            values["track"] = form.fields["track"].queryset.filter(slug=values["track"]).first()
        foreign = form._foreign(values | {"box_choice": form.initial.get("box_choice")})
        values |= {name: usual(name) for name in foreign}
        values = {name: _meant(form, name, value) for name, value in values.items()}
    if values.get("track") is None:
        return Preview(None, [], ())
    race = Race(**values)
    problems: dict[str, Any] = dict(problems_of(race))
    if not problems:
        try:
            check_layout(race)
        except ValidationError as error:
            problems = error.error_dict
    own = {name: form.errors[name].as_data()[0] for name in LAYOUT if form.is_bound and name in form.errors}
    if not own and not submitted and _waits_for_boxes(form, problems):
        hint = _("No boxes yet. Place 1 to %(most)s on the track, or let the seed place them.")
        return Preview(race, [], (), hint % {"most": MAX_BOXES})
    sentences = _sentences(own or problems)
    if not sentences:
        return Preview(race, [], box_marks(race, numbered=True))
    if race.race_type != RaceType.OBJECT_AVOIDANCE or race.random_boxes:
        return Preview(race, sentences, ())
    typed = form["boxes"].value() if form.is_bound else values["boxes"]
    boxes, all_of_them = typed_boxes(race, form.fields["boxes"].each(typed))
    return Preview(race, list(dict.fromkeys([*sentences, *all_of_them])), boxes)


def _waits_for_boxes(form: LayoutForm, problems: dict[str, Any]) -> bool:
    """Whether all that is wrong is that no box was placed, and nothing was typed that says so."""
    errors = [error for each in problems.values() for error in (each if isinstance(each, list) else [each])]
    typed = form["random_boxes"].value() if form["box_choice"].value() == DRAWN else None
    return [error.code for error in errors] == ["race_needs_boxes"] and typed in (None, "")


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


def _sentences(problems: dict[str, Any]) -> list[str]:
    errors = (error for each in problems.values() for error in (each if isinstance(each, list) else [each]))
    return list(dict.fromkeys(text for error in errors for text in error.messages))

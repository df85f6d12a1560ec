"""The forms of a race's organiser."""

from __future__ import annotations

import zoneinfo
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from typing import Any

from django import forms
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from evaluation.templatetags.garage import SENSOR_NAMES
from paddock.errors import UserFault

from .course_form import DRAWN, FIXED, PROPOSALS, CourseForm
from .errors import RaceRefused
from .fields import MomentField, ResetsField, SecondsField
from .models import Race, RaceState, RaceType, RankingMethod, Visibility
from .sensors import OFFERABLE
from .services.races import edition_of
from .validation import EDITABLE_FIELDS, RULE_FIELDS, TEXT_FIELDS

DEFAULT_DURATION = timedelta(days=7)
_NOT_OF_A_RACE = ("track", "time_zone", "box_choice", "edition")


class RaceForm(CourseForm):
    """A community race. What a race may be is decided by the race's own validation, not here."""

    name = forms.CharField(label=_("Name"), max_length=64)
    description = forms.CharField(
        label=_("Description"), required=False, max_length=2000, widget=forms.Textarea(attrs={"rows": 3})
    )
    opens_at = MomentField(label=_("Opens"))
    closes_at = MomentField(label=_("Closes"))
    laps = forms.IntegerField(label=_("Laps driven"), min_value=1, max_value=20)
    minimum_laps = forms.IntegerField(
        label=_("Laps in a row to be classified"),
        min_value=1,
        max_value=20,
        help_text=_("The average is taken over this many consecutive complete laps."),
    )
    ranking_method = forms.ChoiceField(label=_("Ranked by"), choices=RankingMethod.choices)
    off_track_penalty_ms = SecondsField(
        label=_("Off-track penalty in seconds"),
        min_value=0,
        max_value=60,
        help_text=_("The car stands still for so long before it goes on."),
    )
    collision_penalty_ms = SecondsField(
        label=_("Collision penalty in seconds"),
        min_value=0,
        max_value=60,
        required=False,
        help_text=_("For running into a box, a bot or another car."),
    )
    max_resets = ResetsField(label=_("Resets allowed"), help_text=_("0: the first fault ends the run."))
    max_simulated_ms = SecondsField(
        label=_("Time limit in seconds"), min_value=10, max_value=1200, help_text=_("Simulated time for the whole run.")
    )
    max_submissions = forms.IntegerField(label=_("Submissions for each racer"), min_value=1, max_value=1000)
    shared_cars = forms.BooleanField(
        label=_("One car may race for several racers"),
        required=False,
        help_text=_("For teams and classes. Otherwise whoever sent a car first keeps its place."),
    )
    sensors = forms.MultipleChoiceField(
        label=_("Sensors offered"),
        choices=[(name, _(SENSOR_NAMES[name])) for name in OFFERABLE],
        widget=forms.CheckboxSelectMultiple,
        help_text=_("Only models that read no others can be sent."),
    )
    visibility = forms.ChoiceField(
        label=_("Who may join"),
        choices=[
            (Visibility.PUBLIC, _("everybody")),
            (Visibility.INVITATION, _("who has the invitation link; nobody else sees the race")),
        ],
        widget=forms.RadioSelect,
    )
    time_zone = forms.CharField(required=False, widget=forms.HiddenInput)
    edition = forms.CharField(required=False, widget=forms.HiddenInput)

    def __init__(
        self, *args: Any, race: Race | None = None, locked: Iterable[str] = (), now: datetime, **kwargs: Any
    ) -> None:
        """``race`` is the race that is changed, if there is one; ``locked`` are its fields that may not change now."""
        super().__init__(*args, initial=_initial(race, now) | kwargs.pop("initial", {}), **kwargs)
        self.race = race
        for name in (*locked, *(["box_choice"] if "boxes" in locked else [])):
            if name in self.fields:
                self.fields[name].disabled = True
        for name in ("opens_at", "closes_at"):
            moment = self.initial.get(name)
            if not self.is_bound and moment is not None:
                self.fields[name].widget.attrs["data-utc"] = moment.astimezone(UTC).isoformat()

    def clean(self) -> dict[str, Any]:
        """Read the moments in the time zone that the page named, the site's own if none.

        A page shows no seconds: a moment that was not touched keeps its own.
        """
        cleaned = super().clean()
        self._clean_collision_penalty(cleaned)
        zone = _zone(cleaned.pop("time_zone", ""))
        for name in ("opens_at", "closes_at"):
            typed = cleaned.get(name)
            if typed is None or typed.tzinfo is not None:
                continue
            typed = typed.replace(tzinfo=zone)
            stored = getattr(self.race, name, None)
            untouched = stored is not None and stored.replace(second=0, microsecond=0) == typed
            cleaned[name] = stored if untouched else typed
        return cleaned

    def _clean_collision_penalty(self, cleaned: dict[str, Any]) -> None:
        """A time trial has nothing to run into, and its page does not send the field: what stood stands."""
        name = "collision_penalty_ms"
        if cleaned.get("race_type") == RaceType.TIME_TRIAL:
            self.errors.pop(name, None)
            cleaned[name] = None
        if name not in self.errors and cleaned.get(name) is None:
            cleaned[name] = getattr(self.race or Race(), name)

    def changes(self) -> dict[str, Any]:
        """What the form says, for the services; what may not change any more is left out."""
        return {
            name: value
            for name, value in self.cleaned_data.items()
            if name in EDITABLE_FIELDS and not self.fields[name].disabled
        }

    def show(self, fault: UserFault) -> None:
        """Show a refusal, each problem beside its field where the form has it."""
        if not isinstance(fault, RaceRefused) or not hasattr(fault.errors, "error_dict"):
            add_fault(self, fault)
            return
        for field, errors in fault.errors.error_dict.items():
            self.add_error(self.place_error(field), errors)


def locked_fields(race: Race, now: datetime, *, submissions: bool) -> set[str]:
    """Fields of a race that may not change any more (races.validation says the same, and decides)."""
    state = race.state_at(now)
    if state in (RaceState.CLOSED, RaceState.CANCELLED):
        return set(EDITABLE_FIELDS) - set(TEXT_FIELDS)
    locked = set(RULE_FIELDS) if submissions else set()
    return locked | {"opens_at"} if state == RaceState.OPEN else locked


class ReasonForm(forms.Form):
    """Why something is done to others."""

    reason = forms.CharField(label=_("Reason"), max_length=255)


def _initial(race: Race | None, now: datetime) -> dict[str, Any]:
    source = race or Race(opens_at=now.replace(second=0, microsecond=0), closes_at=_evening(now + DEFAULT_DURATION))
    values = {name: getattr(source, name) for name in RaceForm.base_fields if name not in _NOT_OF_A_RACE}
    values |= {name: timezone.localtime(values[name]) for name in ("opens_at", "closes_at")}
    values |= {name: proposal for name, proposal in PROPOSALS.items() if not values[name]}
    values["box_choice"] = FIXED if source.boxes else DRAWN
    values["edition"] = edition_of(race) if race else ""
    return values | {"track": race.track.slug if race else None, "time_zone": timezone.get_current_timezone_name()}


def _evening(moment: datetime) -> datetime:
    return timezone.localtime(moment).replace(hour=23, minute=59, second=0, microsecond=0)


def _zone(name: str) -> zoneinfo.ZoneInfo:
    try:
        return zoneinfo.ZoneInfo(name) if name else timezone.get_current_timezone()
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        return timezone.get_current_timezone()

"""The forms of a race's organiser."""

import zoneinfo
from collections.abc import Iterable
from copy import copy
from datetime import UTC, datetime, timedelta
from types import new_class
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.db.models import Q, QuerySet
from django.forms.models import fields_for_model
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer, RacerGroup
from core.forms import differs, ignored_fields
from paddock.errors import UserFault
from paddock.rules.race import BY_PLACE, OF_ENTERING, OF_SOME_TYPES, RANKING, RULES

from ..errors import RaceRefused
from ..models import Race, RaceKind, RaceState, Visibility
from ..models.race import MINIMUM_LAP_MS, SESSION_S
from ..rules import validation
from ..rules.fields import drop_rules_of_other_types, rule_fields, rules_of_other_types
from ..rules.form_fields import BesideField, MomentField
from ..rules.layout_form import DRAWN, FIXED, PROPOSALS, LayoutForm, show_refusal
from .services import edition_of

DEFAULT_DURATION = timedelta(days=7)
_NOT_OF_A_RACE = ("track", "time_zone", "box_choice", "edition")


_ELSEWHERE = (*OF_SOME_TYPES, *OF_ENTERING, "sensors")
_OF_REAL_CARS = ("session_s", "minimum_lap_ms")
# What every race has, in rows of three on a page.
_IN_ROWS = tuple(name for name in BY_PLACE if name not in (*LayoutForm.base_fields, *_ELSEWHERE))
_FIELDS = rule_fields((*_IN_ROWS, *_ELSEWHERE)) | fields_for_model(
    Race,
    ("name", "description", "prize", "sponsor", "terms", "physical", "team_entries"),
    widgets={name: forms.Textarea(attrs={"rows": rows}) for name, rows in (("description", 3), ("terms", 4))},
)
# Checks of several fields: where one of them cannot be read, nothing is known about the others.
_TOGETHER = (
    set(RANKING),
    {"group", "visibility"},
    {*validation.PHYSICAL_FIELDS, "race_type", "beside", "track"},
    validation.LAID_OUT_BY,
)
_RuleFields = new_class("RuleFields", (LayoutForm,), exec_body=lambda body: body.update(_FIELDS))


class RaceForm(_RuleFields):  # type: ignore[misc, valid-type]
    """A community race. What a race may be is decided by the race's own validation, not here."""

    session_s = forms.IntegerField(
        label=_("Session (s)"),
        required=False,
        min_value=SESSION_S[0],
        max_value=SESSION_S[1],
        help_text=_("A racer's turn on the track. Of real cars."),
    )
    minimum_lap_ms = forms.IntegerField(
        label=_("Shortest possible lap (ms)"),
        required=False,
        min_value=MINIMUM_LAP_MS[0],
        max_value=MINIMUM_LAP_MS[1],
        help_text=_("Two crossings closer together are one. Of real cars."),
    )
    beside = BesideField(
        label=_("Simulated counterpart"),
        required=False,
        help_text=_(
            "The address of a simulated race on the same track. Its results are shown beside those of the real cars."
        ),
    )
    opens_at = MomentField(label=_("Opens"))
    closes_at = MomentField(label=_("Closes"))
    visibility = forms.ChoiceField(
        label=_("Open to"),
        choices=[
            (Visibility.PUBLIC, _("everybody")),
            (Visibility.INVITATION, _("racers with the invitation link; hidden from others")),
        ],
        widget=forms.RadioSelect,
    )
    group = forms.ModelChoiceField(
        label=_("For a group alone"),
        required=False,
        queryset=RacerGroup.objects.none(),
        empty_label=_("for everybody"),
        help_text=_("Only its confirmed members may enter; they need no link."),
    )
    time_zone = forms.CharField(required=False, widget=forms.HiddenInput)
    edition = forms.CharField(required=False, widget=forms.HiddenInput)

    def __init__(
        self,
        *args: Any,
        race: Race | None = None,
        locked: Iterable[str] = (),
        now: datetime,
        groups: QuerySet[RacerGroup] | None = None,
        organiser: Racer | None = None,
        **kwargs: Any,
    ) -> None:
        """``locked``: unchangeable fields; ``groups``: the choices of the group; ``organiser``: that of a new race."""
        super().__init__(*args, initial=_initial(race, now) | kwargs.pop("initial", {}), **kwargs)
        self.race, self.now, self.organiser = race, now, organiser
        own = RacerGroup.objects.filter(pk__in=[race.group_id] if race and race.group_id else [])
        of_group = self.fields["group"]
        assert isinstance(of_group, forms.ModelChoiceField)
        of_group.queryset = own if groups is None else RacerGroup.objects.filter(Q(pk__in=groups) | Q(pk__in=own))
        if not of_group.queryset.exists():
            del self.fields["group"]
        for name in (*locked, *(["box_choice"] if "boxes" in locked else [])):
            if name in self.fields:
                self.fields[name].disabled = True
        for name in ("opens_at", "closes_at"):
            moment = self.initial.get(name)
            if not self.is_bound and moment is not None:
                self.fields[name].widget.attrs["data-utc"] = moment.astimezone(UTC).isoformat()

    def clean(self) -> dict[str, object]:
        """Read the moments in the page's time zone; an untouched moment keeps its seconds, which the page does not
        show."""
        cleaned = super().clean()
        if "description" in cleaned:  # browsers send CR LF
            cleaned["description"] = cleaned["description"].replace("\r\n", "\n")
        self._clean_unsent(cleaned)
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

    def _post_clean(self) -> None:
        """Add the race's own validation errors to those of unreadable fields, to report all at once."""
        super()._post_clean()
        if not self.errors:
            return
        unread = set(self.errors)
        race, before = Race(kind=RaceKind.COMMUNITY, organiser=self.organiser), None
        if self.race is not None:
            race, before = copy(self.race), self.race if self.race.pk else None
        changes = dict.fromkeys({"opens_at", "closes_at"} & unread) | self.changes()
        for name, value in changes.items():
            setattr(race, name, value)
        try:
            validation.check_race(race, now=self.now, before=before)
        except RaceRefused as refused:
            for field, errors in refused.errors.error_dict.items():
                place = self.place_error(field)
                unsure = any(field in names and names & unread for names in _TOGETHER)
                if place is not None and place not in unread and not unsure:
                    self.add_error(place, ValidationError(errors))

    def _clean_unsent(self, cleaned: dict[str, object]) -> None:
        """What a page does not send stays as it stood: a time trial has nothing to run into."""
        drop_rules_of_other_types(self, cleaned)
        for name in (*_IN_ROWS, *_ELSEWHERE, *_OF_REAL_CARS):
            if name in RULES and RULES[name].optional and name in self.data:
                continue  # an empty field is no limit
            if name not in self.errors and cleaned.get(name) is None:
                cleaned[name] = getattr(self.race or Race(), name)

    def rows(self) -> list[list[forms.BoundField]]:
        """The rules that every race has, three to a row."""
        return [[self[name] for name in _IN_ROWS[at : at + 3]] for at in range(0, len(_IN_ROWS), 3)]

    def changes(self) -> dict[str, object]:
        """The form's values for the services, without locked fields."""
        return {
            name: value
            for name, value in self.cleaned_data.items()
            if name in validation.EDITABLE_FIELDS and not self.fields[name].disabled
        }

    def ignored(self) -> list[str]:
        """The names of submitted and ignored fields, except for those outside the race's type."""
        kept = {name for name in ("opens_at", "closes_at") if self.fields[name].disabled and not self._moves(name)}
        foreign = [*self._foreign(self.cleaned_data), *rules_of_other_types(self.cleaned_data.get("race_type"))]
        others = [name for name in foreign if name in self.fields and self._sends(name)]
        return list(dict.fromkeys([*(name for name in ignored_fields(self) if name not in kept), *others]))

    def _sends(self, name: str) -> bool:
        """Whether another value of a field was sent than its page shows."""
        field = self.fields[name]
        if field.disabled or field.widget.value_omitted_from_data(self.data, self.files, name):
            return False
        sent = bool(field.widget.value_from_datadict(self.data, self.files, name))
        return sent and differs(field, self.get_initial_for_field(field, name), self.data, name)

    def _moves(self, name: str) -> bool:
        """Whether another minute was sent for a moment that may not move."""
        try:
            typed = self.fields[name].to_python(self.data.get(name))
        except ValidationError:
            return True
        zone, stored = _zone(self.data.get("time_zone", "")), getattr(self.race, name)
        return typed is not None and typed.replace(tzinfo=zone) != stored.replace(second=0, microsecond=0)

    def show(self, fault: UserFault) -> None:
        """Show a refusal, each problem beside its field where the form has it."""
        show_refusal(self, fault)


def locked_fields(race: Race, now: datetime, *, submissions: bool) -> set[str]:
    """Fields of a race that may not change any more, for display; races.rules.validation enforces the same rule."""
    state = race.state_at(now)
    if state in (RaceState.CLOSED, RaceState.CANCELLED):
        return set(validation.EDITABLE_FIELDS) - set(validation.TEXT_FIELDS)
    locked = set(validation.RULE_FIELDS) if submissions else set()
    return locked | {"opens_at"} if state == RaceState.OPEN else locked


class ReasonForm(forms.Form):
    reason = forms.CharField(label=_("Reason"), max_length=255)


def _initial(race: Race | None, now: datetime) -> dict[str, object]:
    evening = timezone.localtime(now + DEFAULT_DURATION).replace(hour=23, minute=59, second=0, microsecond=0)
    source = race or Race(opens_at=now.replace(second=0, microsecond=0), closes_at=evening)
    values = {name: getattr(source, name) for name in RaceForm.base_fields if name not in _NOT_OF_A_RACE}
    values |= {name: timezone.localtime(values[name]) for name in ("opens_at", "closes_at")}
    values["beside"] = source.beside or ""
    values |= {name: proposal for name, proposal in PROPOSALS.items() if not values[name]}
    values["box_choice"] = FIXED if source.boxes else DRAWN
    values["edition"] = edition_of(race) if race else ""
    return values | {"track": race.track.slug if race else None, "time_zone": timezone.get_current_timezone_name()}


def _zone(name: str) -> zoneinfo.ZoneInfo:
    try:
        return zoneinfo.ZoneInfo(name) if name else timezone.get_current_timezone()
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        return timezone.get_current_timezone()

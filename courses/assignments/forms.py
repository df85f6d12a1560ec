"""The teacher's forms: an assignment, one of its parts, an extension, a submission group, a reference row."""

import zoneinfo
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from types import new_class
from typing import Any

from django import forms
from django.core.exceptions import NON_FIELD_ERRORS
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from accounts.models import RacerGroup
from core.forms import add_fault
from paddock.errors import UserFault
from paddock.rules.race import OF_SOME_TYPES, OWN_RULES, RULES, RUN_RULES, RaceRules
from races.errors import RaceRefused
from races.models.rules import usual
from races.rules.fields import drop_rules_of_other_types, rule_fields
from races.rules.form_fields import MomentField, SecondsField
from races.rules.layout_form import DRAWN, FIXED, PROPOSALS, LayoutForm
from races.test_runs.rules import own_rules
from tracks.models import Track
from tracks.selectors import shared_tracks

from ..marking.facts import Threshold
from ..marking.pass_rules import PASS_RULES, Param, PassRule
from ..models import Assignment, AssignmentPart, Counts, Shows, TrackKind
from ..models.assignment import MOST_HIDDEN
from .parts import PartValues
from .services import MOMENTS, is_far

TWO_WEEKS = timedelta(days=14)
_OTHER_NAMES = ("US/", "Etc/", "Brazil/", "Canada/", "Chile/", "Mexico/", "SystemV/")


@lru_cache(maxsize=1)
def _zones() -> tuple[tuple[str, str], ...]:
    """The time zones of places, and UTC."""
    known = sorted(name for name in zoneinfo.available_timezones() if "/" in name and not name.startswith(_OTHER_NAMES))
    return tuple((name, name.replace("_", " ")) for name in ("UTC", *known))


def local_moment(typed: datetime, zone: zoneinfo.ZoneInfo) -> datetime:
    """A time of a zone's clock; of the two when the clocks go back, the earlier. Raises ValidationError for one that
    the clocks skip."""
    if is_far(typed):
        raise forms.ValidationError(forms.DateTimeField.default_error_messages["invalid"], code="invalid")
    moment = typed.replace(tzinfo=zone)
    if moment.astimezone(UTC).astimezone(zone).replace(tzinfo=None) != typed.replace(fold=0):
        raise forms.ValidationError(gettext("The clocks go forward then: this time does not exist. Choose another."))
    return moment


class _Moments(forms.Form):
    """Moments typed in the time zone of an assignment. An untouched one keeps its seconds, which a page does not
    show."""

    moments: tuple[str, ...] = MOMENTS

    def read_moments(self, zone: zoneinfo.ZoneInfo, stored: Assignment | None) -> None:
        cleaned = self.cleaned_data
        for name in self.moments:
            typed = cleaned.get(name)
            if typed is None or typed.tzinfo is not None:
                continue
            before = getattr(stored, name, None)
            shown = before and before.astimezone(zone).replace(tzinfo=None, second=0, microsecond=0)
            try:
                cleaned[name] = before if shown == typed else local_moment(typed, zone)
            except forms.ValidationError as error:
                self.add_error(name, error)


def show_fault(form: forms.Form, fault: UserFault) -> None:
    """Show what a service refused, beside the field that it names."""
    if isinstance(fault, RaceRefused) and hasattr(fault.errors, "error_dict"):
        for field, errors in fault.errors.error_dict.items():
            form.add_error(field if field in form.fields else None, errors)
        return
    named = fault.params.get("field")
    add_fault(form, fault, named if isinstance(named, str) and named in form.fields else None)


class AssignmentForm(_Moments):
    """What an assignment is, without its parts."""

    group = forms.ModelChoiceField(
        label=_("Class or group"), queryset=RacerGroup.objects.none(), empty_label=None, to_field_name="slug"
    )
    title = forms.CharField(label=_("Title"), max_length=80)
    instructions = forms.CharField(
        label=_("Instructions"), required=False, max_length=10_000, widget=forms.Textarea(attrs={"rows": 4})
    )
    time_zone = forms.ChoiceField(
        label=_("Time zone"), choices=_zones, help_text=_("Deadlines and days are counted by its clocks.")
    )
    opens_at = MomentField(label=_("Opens"))
    due_at = MomentField(label=_("Due"), help_text=_("An attempt at this very moment is still in time."))
    last_at = MomentField(
        label=_("Late attempts until"), required=False, help_text=_("Empty: nothing after the deadline.")
    )
    late_points_a_day = forms.DecimalField(
        label=_("Points off for each late day"),
        required=False,
        min_value=0,
        max_digits=6,
        decimal_places=2,
        help_text=_("Each late day begins at the time of day of the deadline."),
    )
    attempts_a_day = forms.IntegerField(label=_("Attempts a day"), required=False, min_value=1, max_value=1000)
    attempts_in_all = forms.IntegerField(label=_("Attempts in all"), required=False, min_value=1, max_value=1000)
    counts = forms.ChoiceField(label=_("Attempt that counts"), choices=Counts.choices)
    first_k = forms.IntegerField(
        label=_("How many first attempts"),
        required=False,
        min_value=1,
        max_value=1000,
        help_text=_("Only where the best of the first attempts counts."),
    )
    shows = forms.ChoiceField(label=_("Students see"), choices=Shows.choices, widget=forms.RadioSelect)

    def __init__(
        self, *args: Any, assignment: Assignment | None = None, groups: Any = None, now: datetime, **kwargs: Any
    ) -> None:
        """``groups``: those of a new assignment to choose from."""
        kwargs["initial"] = _initial(assignment, now) | kwargs.get("initial", {})
        super().__init__(*args, **kwargs)
        self.assignment = assignment
        if groups is None:
            del self.fields["group"]
        else:
            self.fields["group"].queryset = groups  # type: ignore[attr-defined]
        for name in ("attempts_a_day", "attempts_in_all"):
            self.fields[name].widget.attrs["placeholder"] = _("unlimited")

    def clean(self) -> dict[str, object]:
        cleaned = super().clean() or {}
        cleaned["instructions"] = (cleaned.get("instructions") or "").replace("\r\n", "\n")
        cleaned["late_points_a_day"] = cleaned.get("late_points_a_day") or 0
        if cleaned.get("counts") != Counts.FIRST_K:
            cleaned["first_k"] = None
        elif not cleaned.get("first_k") and "first_k" not in self.errors:
            self.add_error("first_k", gettext("Say how many of the first attempts count."))
        if "time_zone" in cleaned:
            self.read_moments(zoneinfo.ZoneInfo(cleaned["time_zone"]), self.assignment)
        return cleaned

    def values(self) -> dict[str, object]:
        """The columns, as the services take them."""
        return {name: value for name, value in self.cleaned_data.items() if name != "group"}


def _initial(assignment: Assignment | None, now: datetime) -> dict[str, object]:
    if assignment is None:
        named = timezone.get_current_timezone_name()
        known = named if named in dict(_zones()) else "UTC"
        opens = _on_its_clock(now, zoneinfo.ZoneInfo(known)).replace(second=0, microsecond=0)
        evening = (opens + TWO_WEEKS).replace(hour=23, minute=59)
        usually = {"time_zone": known, "counts": Counts.BEST, "shows": Shows.OWN, "late_points_a_day": 0}
        return {**usually, "opens_at": opens, "due_at": evening}
    zone = zoneinfo.ZoneInfo(assignment.time_zone)
    values = {name: getattr(assignment, name) for name in AssignmentForm.base_fields if name != "group"}
    return values | {name: values[name] and _on_its_clock(values[name], zone) for name in MOMENTS}


def _on_its_clock(moment: datetime, zone: zoneinfo.ZoneInfo) -> datetime:
    """As a zone's clock shows it, without a time zone, so that the form does not turn it into the reader's."""
    return moment.astimezone(zone).replace(tzinfo=None)


# --- parts ------------------------------------------------------------------------------------------------------------

_IN_ROWS = tuple(
    name
    for name in sorted(OWN_RULES, key=lambda name: OWN_RULES[name].place)
    if name in RUN_RULES and name in RULES and name not in LayoutForm.base_fields
)
_RuleFields = new_class("RuleFields", (LayoutForm,), exec_body=lambda body: body.update(rule_fields(_IN_ROWS)))


class ThresholdsField(forms.CharField):
    """Times in seconds and points, a line each: ``12.5: 40``."""

    widget = forms.Textarea

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(widget=forms.Textarea(attrs={"rows": 4, "placeholder": "12.5: 40\n15: 25"}), **kwargs)

    def prepare_value(self, value: Any) -> Any:
        if isinstance(value, list | tuple):
            return "\n".join(f"{one['at_most_ms'] / 1000:g}: {one['points']}" for one in value)
        return value

    def clean(self, value: Any) -> list[Threshold]:
        """The fastest first."""
        found: list[Threshold] = []
        for number, line in enumerate(filter(None, map(str.strip, super().clean(value).splitlines())), 1):
            time, _colon, points = line.partition(":")
            try:
                found.append({"at_most_ms": round(float(time) * 1000), "points": f"{float(points):g}"})
            except (ValueError, OverflowError):
                raise forms.ValidationError(
                    gettext("Line %(number)s: write seconds, a colon and points, such as 12.5: 40."),
                    params={"number": number},
                ) from None
        return sorted(found, key=lambda one: one["at_most_ms"])


def param_name(code: str, param: Param) -> str:
    """The name of a form's field for a value of a rule for passing."""
    return f"{code}_{param.name}"


def _param_field(param: Param) -> forms.Field:
    options: dict[str, Any] = {"label": gettext(param.label), "required": False, "initial": param.default}
    if param.kind == "bool":
        return forms.BooleanField(**options)
    if param.kind == "choice":
        return forms.ChoiceField(choices=[(value, gettext(word)) for value, word in param.choices], **options)
    if param.kind == "thresholds":
        return ThresholdsField(**options, help_text=gettext("A line each: seconds, a colon, points."))
    if param.unit == "ms":
        options["label"] += " (s)"
        return SecondsField(min_value=param.least / 1000, max_value=param.most // 1000, **options)
    return forms.IntegerField(min_value=param.least, max_value=param.most, **options)


class PartForm(_RuleFields):  # type: ignore[misc, valid-type]
    """A part of an assignment: what is driven where, and how that is graded."""

    title = forms.CharField(label=_("Title"), max_length=80)
    points = forms.DecimalField(label=_("Points"), min_value=0.01, max_value=1000, max_digits=6, decimal_places=2)
    pass_rule = forms.ChoiceField(label=_("Rule for passing"), widget=forms.RadioSelect)
    more_tracks = forms.MultipleChoiceField(label=_("More tracks"), required=False, widget=forms.CheckboxSelectMultiple)
    candidates = forms.MultipleChoiceField(
        label=_("Candidates for hidden tracks"), required=False, widget=forms.CheckboxSelectMultiple
    )
    hidden_tracks = forms.IntegerField(
        label=_("Hidden tracks to draw"),
        required=False,
        min_value=0,
        max_value=MOST_HIDDEN,
        help_text=_("Drawn from the candidates at the deadline and shown then. Until then only teachers see them."),
    )

    def __init__(
        self,
        data: Any = None,
        *,
        part: AssignmentPart | None = None,
        initial: Mapping[str, Any] | None = None,
        is_driven: bool = False,
    ) -> None:
        """``is_driven``: students have handed in, so that only title, points and the rule for passing may change."""
        super().__init__(data, initial={**_proposed(), **(values_of_part(part) if part else {}), **(initial or {})})
        named = {track.slug: track for track in shared_tracks()}
        for name in ("more_tracks", "candidates"):
            self.fields[name].choices = [(slug, track.name) for slug, track in named.items()]
        self.tracks_by_slug: dict[str, Track] = named
        self.fields["pass_rule"].choices = [(code, gettext(rule.label)) for code, rule in PASS_RULES.items()]
        self.fields["opponents"].choices = [("bots", dict(self.fields["opponents"].choices).get("bots", "bots"))]
        for code, rule in PASS_RULES.items():
            for param in rule.params:
                self.fields[param_name(code, param)] = _param_field(param)
        if is_driven:
            for name in (*LayoutForm.base_fields, *_IN_ROWS, "more_tracks", "candidates", "hidden_tracks"):
                self.fields[name].disabled = True

    def rows(self) -> list[list[forms.BoundField]]:
        """The rules that every run has, three to a row."""
        names = [name for name in _IN_ROWS if name not in OF_SOME_TYPES]
        return [[self[name] for name in names[at : at + 3]] for at in range(0, len(names), 3)]

    def rule_params(self) -> list[tuple[str, list[forms.BoundField]]]:
        """The fields of each rule for passing."""
        return [(code, [self[param_name(code, param)] for param in rule.params]) for code, rule in PASS_RULES.items()]

    def ticks(self) -> list[tuple[str, forms.BoundField, list[Track], list[str]]]:
        """The two lists of tracks to tick: name, field, tracks, and the ticked slugs."""
        tracks = list(self.tracks_by_slug.values())
        return [(name, self[name], tracks, list(self[name].value() or ())) for name in ("more_tracks", "candidates")]

    def clean(self) -> dict[str, object]:
        """Values of other race types and of other rules for passing are dropped; tracks stand once."""
        cleaned = super().clean() or {}
        drop_rules_of_other_types(self, cleaned)
        for name in _IN_ROWS:
            if name not in self.errors and cleaned.get(name) is None:
                cleaned[name] = usual(name)
        chosen = cleaned.get("pass_rule")
        for code, rule in PASS_RULES.items():
            for param in rule.params:
                name = param_name(code, param)
                if code != chosen:
                    self.errors.pop(name, None)
                elif name not in self.errors and cleaned.get(name) in (None, "", []):
                    if param.name == "laps" and not rule.uses_laps(self._params(rule)):
                        cleaned[name] = param.default
                    else:
                        self.add_error(name, gettext("Enter a value."))
        self._clean_tracks()
        return cleaned

    def _params(self, rule: PassRule) -> dict[str, object]:
        return {param.name: self.cleaned_data.get(param_name(rule.code, param)) for param in rule.params}

    def _clean_tracks(self) -> None:
        cleaned = self.cleaned_data
        first = cleaned.get("track")
        slugs = [slug for slug in cleaned.get("more_tracks") or () if first is None or slug != first.slug]
        shown = {first.slug, *slugs} if first else set(slugs)
        candidates = cleaned.get("candidates") or []
        if twice := [self.tracks_by_slug[slug].name for slug in candidates if slug in shown]:
            names = ", ".join(twice)
            message = gettext("Shown already, so it cannot be hidden: %(tracks)s.") % {"tracks": names}
            self.add_error("candidates", message)
        cleaned["hidden_tracks"] = cleaned.get("hidden_tracks") or 0
        if cleaned["hidden_tracks"] > len(candidates):
            message = gettext("Tick at least as many candidates as tracks are drawn.")
            self.add_error("candidates", message)
        cleaned["more_tracks"] = slugs
        if self.errors or first is None:
            return
        for slug in (first.slug, *slugs, *candidates):
            try:
                cleaned["rules"] = own_rules(self.tracks_by_slug.get(slug, first), self._options(cleaned)).rules
            except UserFault as fault:
                self._say_of_track(fault, self.tracks_by_slug.get(slug, first))
                return

    def _options(self, cleaned: Mapping[str, object]) -> dict[str, object]:
        return {
            name: cleaned[name]
            for name in OWN_RULES
            if name in RUN_RULES and name in RULES and cleaned.get(name) is not None
        } | {"opponents": cleaned.get("opponents") or ""}

    def _say_of_track(self, fault: UserFault, track: Track) -> None:
        before = set(self.errors)
        show_fault(self, fault)
        if track != self.cleaned_data.get("track"):
            where = gettext("This does not fit on %(track)s.") % {"track": track.name}
            for name in set(self.errors) - before - {NON_FIELD_ERRORS}:
                self.add_error(name, where)

    def values(self) -> PartValues:
        """The part, as the services take it."""
        cleaned = self.cleaned_data
        rule = PASS_RULES[cleaned["pass_rule"]]
        shown = [cleaned["track"], *(self.tracks_by_slug[slug] for slug in cleaned["more_tracks"])]
        hidden = [self.tracks_by_slug[slug] for slug in cleaned["candidates"]]
        return {
            "title": cleaned["title"],
            "points": cleaned["points"],
            "pass_rule": rule.code,
            "pass_params": self._params(rule),
            "rules": cleaned["rules"].to_dict(),
            "hidden_tracks": cleaned["hidden_tracks"],
            "tracks": [
                *((track, TrackKind.SHOWN) for track in shown),
                *((track, TrackKind.CANDIDATE) for track in hidden),
            ],
        }


def values_of_part(part: AssignmentPart) -> dict[str, object]:
    """A part as initial values of its form."""
    rules: RaceRules = part.race_rules
    values = {name: getattr(rules, name) for name in RUN_RULES if name in RULES and name != "boxes"}
    values["boxes"] = [{"fraction": box.fraction, "lane": box.lane} for box in rules.boxes]
    values["box_choice"] = FIXED if rules.boxes else DRAWN
    values |= {name: proposal for name, proposal in PROPOSALS.items() if not values.get(name)}
    tracks = list(part.tracks.all())
    shown = [one.track.slug for one in tracks if one.kind == TrackKind.SHOWN]
    values |= {"title": part.title, "points": part.points, "pass_rule": part.pass_rule}
    values |= {"track": shown[0] if shown else None, "more_tracks": shown[1:], "hidden_tracks": part.hidden_tracks}
    values["candidates"] = [one.track.slug for one in tracks if one.kind != TrackKind.SHOWN]
    rule = PASS_RULES[part.pass_rule]
    return values | {param_name(rule.code, one): part.pass_params.get(one.name, one.default) for one in rule.params}


def _proposed() -> dict[str, object]:
    usually = {name: usual(name) for name in OWN_RULES if name in RULES and name in RUN_RULES}
    return {**usually, **PROPOSALS, "laps": 5, "box_choice": DRAWN, "pass_rule": next(iter(PASS_RULES)), "points": 100}


# --- exceptions -------------------------------------------------------------------------------------------------------


class ExtensionForm(_Moments):
    """Another deadline for one student."""

    racer = forms.ChoiceField(label=_("Student"))
    due_at = MomentField(label=_("New deadline"))
    last_at = MomentField(label=_("Late attempts until"), required=False)
    reason = forms.CharField(label=_("Reason"), max_length=200)
    moments = ("due_at", "last_at")

    def __init__(self, *args: Any, assignment: Assignment, students: Iterable[tuple[str, str]], **kwargs: Any) -> None:
        """``students``: aliases and names."""
        self.zone = zoneinfo.ZoneInfo(assignment.time_zone)
        later = {"due_at": _on_its_clock(assignment.due_at, self.zone) + timedelta(days=7)}
        kwargs["initial"] = later | kwargs.get("initial", {})
        super().__init__(*args, **kwargs)
        self.fields["racer"].choices = list(students)  # type: ignore[attr-defined]

    def clean(self) -> dict[str, object]:
        cleaned = super().clean() or {}
        self.read_moments(self.zone, None)
        return cleaned


class SubmissionGroupForm(forms.Form):
    """Students that submit together."""

    name = forms.CharField(label=_("Name"), max_length=40)
    racers = forms.MultipleChoiceField(label=_("Students"), widget=forms.CheckboxSelectMultiple)

    def __init__(self, *args: Any, students: Iterable[tuple[str, str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["racers"].choices = list(students)  # type: ignore[attr-defined]


class ReferenceForm(forms.Form):
    """A car on the board that is not ranked."""

    label = forms.CharField(label=_("Label"), max_length=40)
    model = forms.ChoiceField(label=_("Model"))

    def __init__(self, *args: Any, cars: Iterable[tuple[Any, Any]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["model"].choices = list(cars)  # type: ignore[attr-defined]

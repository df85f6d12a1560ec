"""The form that plans a season."""

from __future__ import annotations

import itertools
import zoneinfo
from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Any, cast

from django import forms
from django.core.exceptions import ValidationError
from django.http import QueryDict
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.dates import MONTHS
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from paddock.errors import UserFault
from paddock.rules.race import BOTS_DRIVING, BOX_COUNT, DRAWN_BOXES, DUELS, RANKING, RULES, STAGE, all_laps
from races.errors import RaceRefused, problem
from races.models.rules import lap_problems
from races.models.sensors import OFFERABLE
from races.rules.fields import rule_fields
from tracks.models import Direction, Track

from ...models import Season, Stage, StageRules
from ...models.season import RESERVED_SLUGS
from ..calendars import zone_names
from ..selectors import season_at
from ..services.season_plan import MonthPlan, SeasonPlan, StagePlan, Turn, Turning
from .round_form import RoundChange, read_changes, values_of

STAGES = (Stage.OPEN, Stage.PRO, Stage.FINALE, Stage.CHAMPIONSHIP)
TURNS = ("turn_1", "turn_2", "turn_3")
AS_PRO = "as_pro"  # what stands on the track as in the pro race of the month
LAYOUT = (*DRAWN_BOXES, *BOTS_DRIVING, *DUELS)
_CAMERA = ["FRONT_FACING_CAMERA"]


def _proposed(turns: tuple[str, ...], sensors: list[str], **rules: Any) -> dict[str, object]:
    usual = {name: RULES[name].default_of_a_stage for name in (*STAGE, *LAYOUT)} | {"max_submissions": None}
    turns_by_name = dict(zip(TURNS, (*turns, "", ""), strict=False))
    return usual | turns_by_name | {"sensors": sensors} | rules


# As the official league's were in 2021 and 2022: newcomers drive alone with a camera, pros meet boxes and bots by turns
# with every sensor. A newcomer's car may leave the road; a finale asks for more.
PROPOSALS: dict[str, dict[str, object]] = {
    Stage.OPEN: _proposed((Turn.TIME_TRIAL,), _CAMERA),
    Stage.PRO: _proposed((Turn.BOXES, Turn.BOTS), [*OFFERABLE], laps=5, off_track_penalty_ms=5000),
    Stage.FINALE: _proposed((AS_PRO,), [*OFFERABLE], **all_laps(3), off_track_penalty_ms=5000),
    Stage.CHAMPIONSHIP: _proposed((Turn.MODELS,), [*OFFERABLE], **all_laps(5), off_track_penalty_ms=5000),
}


def stage_fields(stage: Stage) -> dict[str, forms.Field]:
    """The fields of a stage by their names in the form, each with its proposal."""
    made = _turns(stage) | rule_fields((*LAYOUT, "sensors"), strict=True) | rule_fields(STAGE, short=True, strict=True)
    made[BOX_COUNT].label = _("Boxes")
    made[BOX_COUNT].help_text = _("Positions are drawn again each month.")
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


MONTHS_AT_MOST = 12
# Checks of several fields: where one of them cannot be read, nothing is known about the others.
_TOGETHER = ({"finale_size", "championship_places"}, set(RANKING))
DEFAULT_POINTS = "25, 18, 15, 12, 10, 8, 6, 4, 2, 1"


class PointsField(forms.CharField):
    def to_python(self, value: Any) -> list[int]:  # type: ignore[override]  # of a text Django's fields make anything
        """Raises ValidationError("season_points_shape")."""
        text = super().to_python(value) or ""
        try:
            return [int(one) for one in text.replace(",", " ").split()]
        except ValueError:
            raise problem("season_points_shape", most=10_000, places=200) from None


class SeasonForm(forms.Form):
    """First month, tracks by month, race types and rules by stage, and the numbers of the season.

    ``changes``: of single races, as :mod:`league.seasons.forms.round_form` writes them; ``seen``: the last preview's
    digest.
    """

    name = forms.CharField(label=_("Name"), max_length=40, help_text=_("Example: Season 2027."))
    slug = forms.SlugField(label=_("Address"), max_length=40, help_text=_("In links: /seasons/2027/."))
    year = forms.IntegerField(label=_("Year"), min_value=2000, max_value=2200)
    first_month = forms.TypedChoiceField(
        label=_("First month"), choices=[(number, MONTHS[number]) for number in MONTHS], coerce=int, initial=1
    )
    turning = forms.ChoiceField(label=_("Direction"), choices=Turning.choices, initial=Turning.CCW)
    zone = forms.ChoiceField(
        label=_("Time zone"),
        help_text=_("Races open and close at midnight in this time zone, on the first of a month."),
    )
    finale_day = forms.IntegerField(label=_("Finale: day of the next month"), min_value=1, max_value=28, initial=10)
    finale_hour = forms.IntegerField(label=_("Finale: opens at hour"), min_value=0, max_value=23, initial=18)
    finale_hours = forms.IntegerField(label=_("Finale: hours open"), min_value=1, max_value=240, initial=24)
    championship_days = forms.IntegerField(
        label=_("Championship: days after the last finale"), min_value=1, max_value=120, initial=7
    )
    championship_hours = forms.IntegerField(label=_("Championship: hours open"), min_value=1, max_value=720, initial=48)
    promotion_percent = forms.DecimalField(
        label=_("Promoted (%)"),
        max_digits=4,
        decimal_places=1,
        initial=10,
        help_text=_("Share of the classified racers of a month's open race; at least one."),
    )
    finale_size = forms.IntegerField(label=_("Cars in a finale"), min_value=1, max_value=1000, initial=16)
    championship_places = forms.IntegerField(
        label=_("Championship places per finale"), min_value=1, max_value=1000, initial=3
    )
    points = PointsField(
        label=_("Points by place"), initial=DEFAULT_POINTS, help_text=_("Winner's points first, in descending order")
    )
    drop_worst = forms.IntegerField(
        label=_("Worst results dropped"),
        min_value=0,
        max_value=11,
        initial=0,
        help_text=_("A missed round counts as 0 points."),
    )
    steward_hours = forms.IntegerField(
        label=_("Steward window in hours"),
        min_value=0,
        max_value=24 * 60,
        initial=48,
        help_text=_("Results can be corrected for this long after a round has closed."),
    )
    prizes = forms.CharField(
        label=_("Prizes"), required=False, max_length=4000, widget=forms.Textarea(attrs={"rows": 3})
    )
    changes = forms.CharField(required=False, widget=forms.HiddenInput)
    seen = forms.CharField(required=False, widget=forms.HiddenInput)
    replaces = forms.ModelChoiceField(
        Season.objects.all(), required=False, to_field_name="slug", widget=forms.HiddenInput
    )

    OF_A_SEASON = ("promotion_percent", "finale_size", "championship_places", "points", "drop_worst", "steward_hours")

    def __init__(self, *args: Any, now: datetime, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.now = now
        self.tracks = {track.slug: track for track in Track.objects.order_by("name") if track.has_shape}
        choices = [(slug, track.name) for slug, track in self.tracks.items()]
        cast("forms.ChoiceField", self.fields["zone"]).choices = [(name, name) for name in zone_names()]
        self.fields["zone"].initial = timezone.get_default_timezone_name()
        year = now.year + (now.month > 6)
        for name, value in {"year": year, "slug": str(year), "name": f"Season {year}"}.items():
            self.fields[name].initial = value
        slugs = list(self.tracks) or [""]
        first = self._first_month()
        self.months = {place: MONTHS[(first + place - 2) % 12 + 1] for place in range(1, MONTHS_AT_MOST + 1)}
        for place, month in self.months.items():
            self._month_fields(place, month, choices, slugs)
        for stage in STAGES:
            self.fields |= stage_fields(stage)

    def clean(self) -> dict[str, object]:
        """Hold the numbers against the season's and the stages' own rules, each refusal on its field."""
        cleaned = super().clean() or self.cleaned_data
        self._check(Season(), {name: name for name in self.OF_A_SEASON}, cleaned)
        for stage in STAGES:
            self._check(StageRules(stage=stage), {name: named(stage, name) for name in STAGE}, cleaned)
        if not any(cleaned.get(f"open_{month}") for month in self.months):
            self.add_error(None, problem("season_without_races"))
        slug = cleaned.get("slug") or ""
        if slug.lower() in RESERVED_SLUGS:
            self.add_error("slug", problem("season_address_reserved", season=slug))
        elif slug and season_at(slug) not in (None, cleaned.get("replaces")):
            self.add_error("slug", problem("season_exists", season=slug))
        return cleaned

    def plan(self, now: datetime, changes: Mapping[str, RoundChange] | None = None) -> SeasonPlan:
        """The plan of the valid form; with ``changes`` of single races instead of those that came with the form."""
        data = self.cleaned_data
        zone = zoneinfo.ZoneInfo(data["zone"])
        changes = self.round_changes() if changes is None else changes
        months = [
            MonthPlan(
                data["first_month"] + place - 1,
                self.tracks[data[f"open_{place}"]],
                self.tracks.get(data[f"pro_{place}"]),
                data[f"direction_{place}"],
            )
            for place in self.months
            if data[f"open_{place}"]
        ]
        times = ("finale_day", "finale_hour", "finale_hours", "championship_days", "championship_hours")
        return SeasonPlan(
            slug=data["slug"],
            name=data["name"],
            year=data["year"],
            zone=zone,
            months=months,
            turning=Turning(data["turning"]),
            stages={stage: stage_plan(stage, data) for stage in STAGES},
            settings={name: data[name] for name in (*self.OF_A_SEASON, "prizes")},
            changes=values_of(changes, now),
            replaces=data["replaces"],
            **{name: data[name] for name in times},
        )

    def repaired(self) -> SeasonForm | None:
        """The form with default values for wrong ones; None without errors, and if one decides what the races are."""
        wrong = set(self.errors)
        if not wrong or not wrong <= {*self.OF_A_SEASON, "name", "slug", "prizes"}:
            return None
        data = QueryDict(mutable=True)
        data.update(self.data)
        usual: dict[str, str] = {"name": "-", "slug": get_random_string(20), "prizes": ""}
        for name in wrong:
            data[name] = usual.get(name, self.fields[name].initial)
        return SeasonForm(data, now=self.now)

    def round_changes(self) -> dict[str, RoundChange]:
        """What single races have instead of their pattern, by key."""
        return read_changes(self.cleaned_data["changes"])

    def show(self, refused: UserFault | ValidationError) -> None:
        """Show above the form what the season or one of its races was refused for."""
        if isinstance(refused, UserFault) and not isinstance(refused, RaceRefused):
            add_fault(self, refused)
            return
        errors = refused.errors if isinstance(refused, RaceRefused) else refused
        for error in itertools.chain(*errors.error_dict.values()) if hasattr(errors, "error_dict") else [errors]:
            self.add_error(None, error)

    def hidden_problems(self) -> list[str]:
        """What is wrong with fields that the page does not show."""
        return [str(error) for field in self.hidden_fields() for error in field.errors]

    def dropped(self) -> list[tuple[str, Track]]:
        """Of a valid form the months without an open race whose pro race is therefore left out, with its track."""
        data = self.cleaned_data
        return [
            (month, self.tracks[data[f"pro_{place}"]])
            for place, month in self.months.items()
            if data[f"pro_{place}"] and not data[f"open_{place}"]
        ]

    def month_rows(self) -> Iterator[tuple[str, list[Any]]]:
        for place, month in self.months.items():
            yield month, [self[f"open_{place}"], self[f"pro_{place}"], self[f"direction_{place}"]]

    def stage_groups(self) -> Iterator[dict[str, object]]:
        """Each stage with its fields: ``turns``, ``boxes``, ``bots``, ``duels``, ``sensors``, ``rules``; ``wrong``: any
        errors."""
        for stage in STAGES:
            group = {"turns": TURNS, "boxes": DRAWN_BOXES, "bots": BOTS_DRIVING, "duels": DUELS, "rules": STAGE}
            shown = {part: [self[named(stage, name)] for name in names] for part, names in group.items()}
            sensors = self[named(stage, "sensors")]
            wrong = any(field.errors for fields in (*shown.values(), [sensors]) for field in fields)
            yield {"stage": stage, "sensors": sensors, "wrong": wrong, **shown}

    def _first_month(self) -> int:
        """The first month as chosen, January where nothing sensible is."""
        value = str(self["first_month"].value() if self.is_bound else self.initial.get("first_month", 1))
        return int(value) if value.isascii() and value.isdecimal() and 1 <= int(value) <= 12 else 1

    def _month_fields(self, place: int, month: str, choices: list[tuple[str, Any]], slugs: list[str]) -> None:
        nothing: list[tuple[str, Any]] = [("", _("no race"))]
        self.fields[f"open_{place}"] = forms.ChoiceField(
            label=_("Open race"), required=False, choices=nothing + choices, initial=slugs[(place - 1) % len(slugs)]
        )
        self.fields[f"pro_{place}"] = forms.ChoiceField(
            label=_("Pro race and finale"), required=False, choices=nothing + choices, initial=slugs[place % len(slugs)]
        )
        self.fields[f"direction_{place}"] = forms.ChoiceField(
            label=_("Direction"), required=False, choices=[("", _("same as the season")), *Direction.choices]
        )
        for kind in ("open", "pro", "direction"):
            shown = self.fields[f"{kind}_{place}"]
            shown.widget.attrs["aria-label"] = _("%(month)s: %(field)s") % {"month": month, "field": shown.label}

    def _check(self, row: Season | StageRules, names: dict[str, str], cleaned: dict[str, object]) -> None:
        for name, shown in names.items():
            if cleaned.get(shown) is not None:
                setattr(row, name, cleaned[shown])
        try:
            row.clean() if isinstance(row, Season) else row.clean_fields(exclude=["season"])
            if isinstance(row, StageRules) and (problems := lap_problems(row)):
                raise ValidationError(problems)
        except ValidationError as refused:
            unread = {name for name, shown in names.items() if shown not in cleaned}
            for name, errors in refused.error_dict.items():
                unsure = any(name in together and together & unread for together in _TOGETHER)
                if name not in unread and not unsure:
                    self.add_error(names[name], errors)

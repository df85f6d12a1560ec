"""The form of a live event's plan."""

from __future__ import annotations

import zoneinfo
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Any

from django import forms
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from paddock.errors import UserFault

from .fields import SecondsField
from .live_rules import MOST_SEED
from .models import LiveEvent, LiveOrder
from .models.live import LEAST_ATTEMPT_MS, MOST_ATTEMPT_MS, MOST_ROUNDS
from .services.live.planning import MOST_GAP_S, PLANNABLE, check_plan

_FIELD_OF = {"live_time_zone": "time_zone", "live_in_the_past": "starts_at", "live_too_far_ahead": "starts_at"}
_FIELD_OF |= {"live_start": "start_m", "track_start_fixed": "start_m", "boxes_do_not_fit": "seed"}


@lru_cache(maxsize=1)
def zones() -> list[str]:
    """The names of all time zones."""
    return sorted(zoneinfo.available_timezones())


class LiveForm(forms.Form):
    """When, how often, for how long, in which order."""

    starts_at = forms.DateTimeField(
        label=_("Starts"),
        help_text=_("In the time zone beside it. The lobby opens an hour before."),
        widget=forms.DateTimeInput(attrs={"type": "datetime-local"}, format="%Y-%m-%dT%H:%M"),
        input_formats=["%Y-%m-%dT%H:%M", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%d %H:%M"],
    )
    time_zone = forms.ChoiceField(label=_("Time zone"))
    rounds = forms.IntegerField(label=_("Rounds"), min_value=1, max_value=MOST_ROUNDS, initial=2)
    attempt_ms = SecondsField(
        label=_("Seconds per attempt"),
        help_text=_("Driving time of each car. The race's rule ranks the laps."),
        min_value=LEAST_ATTEMPT_MS // 1000,
        max_value=MOST_ATTEMPT_MS // 1000,
        initial=180_000,
    )
    start_m = forms.FloatField(
        label=_("Start in metres after the finish line"),
        required=False,
        min_value=0,
        help_text=_("Laps of the event begin and end there. Empty: drawn, and announced with the event."),
        widget=forms.NumberInput(attrs={"step": "0.1"}),
    )
    seed = forms.IntegerField(
        label=_("Seed"),
        required=False,
        min_value=0,
        max_value=MOST_SEED,
        help_text=_("Of boxes and bots that are drawn. Empty: drawn, and announced with the event."),
    )
    order = forms.ChoiceField(label=_("Order"), choices=LiveOrder.choices, initial=LiveOrder.SLOWEST_FIRST)
    gap_s = forms.IntegerField(
        label=_("Seconds between two runs"),
        min_value=0,
        max_value=MOST_GAP_S,
        initial=20,
        help_text=_("Automatic runs only."),
    )
    auto_run = forms.BooleanField(
        label=_("Automatic"),
        required=False,
        help_text=_("The event starts on time and runs automatically."),
    )
    roll_call = forms.BooleanField(
        label=_("Roll call"), required=False, help_text=_("Racers who have not checked in are held.")
    )

    speed_control = forms.BooleanField(
        label=_("Racers set their car's speed"),
        required=False,
        help_text=_("Before a run and while it is played; what they command is part of the result."),
    )

    def __init__(self, data: Any = None, *, event: LiveEvent | None, now: datetime) -> None:
        super().__init__(data, initial=_initial(event, now))
        self.now = now
        self.fields["time_zone"].choices = [(name, name) for name in zones()]  # type: ignore[attr-defined]

    def clean_starts_at(self) -> datetime:
        """As typed: the zone is another field."""
        value: datetime = self.cleaned_data["starts_at"]
        return timezone.make_naive(value) if timezone.is_aware(value) else value

    def _post_clean(self) -> None:
        """Report everything at once: of a form without errors the service says the rest."""
        super()._post_clean()  # type: ignore[misc]  # Django's hook, which the stubs leave out
        if self.errors and not {"starts_at", "time_zone"} & set(self.errors):
            try:
                check_plan({"starts_at": self.plan()["starts_at"]}, self.now)
            except UserFault as fault:
                self.show(fault)

    def plan(self) -> dict[str, Any]:
        """What the services take."""
        said = dict(self.cleaned_data)
        said["starts_at"] = said["starts_at"].replace(tzinfo=zoneinfo.ZoneInfo(said["time_zone"]))
        return said

    def show(self, fault: UserFault) -> None:
        """Show a refusal on the field to change."""
        add_fault(self, fault, _FIELD_OF.get(fault.code))


def _initial(event: LiveEvent | None, now: datetime) -> dict[str, Any]:
    if event is None:
        zone = timezone.get_current_timezone_name()
        start = (now + timedelta(days=1)).astimezone(timezone.get_current_timezone())
        return {"time_zone": zone, "starts_at": start.replace(minute=0, second=0, microsecond=0, tzinfo=None)}
    start = event.starts_at.astimezone(zoneinfo.ZoneInfo(event.time_zone)).replace(tzinfo=None)
    return {"starts_at": start, **{name: getattr(event, name) for name in PLANNABLE if name != "starts_at"}}

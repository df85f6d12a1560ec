"""The forms of a live event's plan and of a speed command."""

import zoneinfo
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Any

from django import forms
from django.forms.models import fields_for_model
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from paddock.errors import UserFault
from paddock.rules.speed import FASTEST_MPS, VALUES

from ..models import LiveEvent
from ..models.live import LEAST_ATTEMPT_MS, MOST_ATTEMPT_MS, MOST_ROUNDS
from ..rules.form_fields import SecondsField
from ..rules.live_start import MOST_SEED
from .services.planning import MOST_GAP_S, PLANNABLE, check_plan

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
    gap_s = forms.IntegerField(
        label=_("Seconds between two runs"),
        min_value=0,
        max_value=MOST_GAP_S,
        initial=20,
        help_text=_("Automatic runs only."),
    )

    def __init__(self, data: Any = None, *, event: LiveEvent | None, now: datetime) -> None:
        super().__init__(data, initial=_initial(event, now))
        self.now = now
        self.fields |= fields_for_model(LiveEvent, ("order", "auto_run", "roll_call", "speed_control"))
        self.fields["time_zone"].choices = [(name, name) for name in zones()]  # type: ignore[attr-defined]

    def clean_starts_at(self) -> datetime:
        """As typed: the zone is another field."""
        value: datetime = self.cleaned_data["starts_at"]
        return timezone.make_naive(value) if timezone.is_aware(value) else value

    def _post_clean(self) -> None:
        """Check the start time even beside other errors, to report all at once; valid forms leave it to the service."""
        super()._post_clean()  # type: ignore[misc]  # Django's hook, which the stubs leave out
        if self.errors and not {"starts_at", "time_zone"} & set(self.errors):
            try:
                check_plan({"starts_at": self.plan()["starts_at"]}, self.now)
            except UserFault as fault:
                self.show(fault)

    def plan(self) -> dict[str, Any]:
        """What the services take."""
        values = dict(self.cleaned_data)
        values["starts_at"] = values["starts_at"].replace(tzinfo=zoneinfo.ZoneInfo(values["time_zone"]))
        return values

    def show(self, fault: UserFault) -> None:
        """Show a refusal on the field to change."""
        add_fault(self, fault, _FIELD_OF.get(fault.code))


def _initial(event: LiveEvent | None, now: datetime) -> dict[str, object]:
    if event is None:
        zone = timezone.get_current_timezone_name()
        start = (now + timedelta(days=1)).astimezone(timezone.get_current_timezone())
        return {"time_zone": zone, "starts_at": start.replace(minute=0, second=0, microsecond=0, tzinfo=None)}
    start = event.starts_at.astimezone(zoneinfo.ZoneInfo(event.time_zone)).replace(tzinfo=None)
    return {"starts_at": start, **{name: getattr(event, name) for name in PLANNABLE if name != "starts_at"}}


_LABELS = {
    "multiplier": _("Factor on the model's speed"),
    "cap": _("At most, in m/s"),
    "absolute": _("Always, in m/s"),
    "percent_max": _("Per cent of 4 m/s"),
    "offset": _("More or less, in m/s"),
    "model_speed": _("Model speed"),
}


def modes() -> list[dict[str, object]]:
    """Each mode with its label and the range of its value, for the page's slider."""
    return [{"name": name, "label": label, "range": VALUES[name]} for name, label in _LABELS.items()]


class SpeedForm(forms.Form):
    """How, how much, and from when."""

    mode = forms.ChoiceField(label=_("How"), choices=list(_LABELS.items()), initial="multiplier")
    value = forms.FloatField(
        label=_("How much"),
        initial=1,
        required=False,
        min_value=-FASTEST_MPS,
        max_value=100,
        widget=forms.NumberInput(attrs={"step": "any", "inputmode": "decimal"}),
    )
    when = forms.ChoiceField(choices=[("now", ""), ("start", "")])

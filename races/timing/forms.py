"""The form to correct a lap."""

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from core.forms import add_fault
from core.times import clock
from paddock.errors import UserFault

from ..models import MeasuredLap
from .services.checks import MOST_FAULTS
from .services.files import time_of


class CorrectionForm(forms.Form):
    """A lap's corrected values and the reason."""

    time = forms.CharField(label=_("Time"), max_length=20, help_text=_("As measured, without penalties: m:ss.mmm."))
    off_tracks = forms.IntegerField(label=_("Off tracks"), min_value=0, max_value=MOST_FAULTS)
    resets = forms.IntegerField(label=_("Resets"), min_value=0, max_value=MOST_FAULTS)
    valid = forms.BooleanField(label=_("The lap is valid"), required=False)
    reason = forms.CharField(label=_("Reason"), max_length=255, help_text=_("Everybody reads it."))

    def __init__(self, *args: Any, lap: MeasuredLap, **kwargs: Any) -> None:
        stands = {"time": clock(lap.time_ms), "off_tracks": lap.off_tracks, "resets": lap.resets, "valid": lap.valid}
        super().__init__(*args, **(kwargs | {"initial": stands}))

    def clean_time(self) -> int:
        """In milliseconds."""
        try:
            return time_of(self.cleaned_data["time"].strip())
        except UserFault as fault:
            raise forms.ValidationError(str(_("Write a time as 0:12.345 or 12.345."))) from fault

    def changes(self) -> dict[str, Any]:
        """For the service."""
        values = dict(self.cleaned_data)
        return {"time_ms": values.pop("time"), **values}

    def show(self, fault: UserFault) -> None:
        """Show why the lap stays as it is."""
        add_fault(self, fault)

"""The form that asks for a report."""

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.forms import add_fault
from paddock.errors import UserFault
from paddock.rules.report import MOST_SEED
from tracks.models import Direction, Track
from tracks.selectors import all_tracks

from ..garage.selectors import cars_of
from ..models.reports import TrackSet
from .selectors import reportable_model

USUAL_TRACK = "oval"  # whose lap is varied unless another is chosen
_FIELDS = {
    "report_model_gone": "model",
    "report_sensors": "model",
    "report_tracks": "tracks",
    "report_too_many_tracks": "tracks",
    "report_no_way_round": "variations_on",
    "variation_not_placed": "variations_on",
    "report_seed": "seed",
    "report_direction": "direction",
}


class ReportForm(forms.Form):
    model = forms.CharField(label=_("Model"), max_length=12, widget=forms.Select)
    track_set = forms.ChoiceField(
        label=_("Tracks"),
        choices=TrackSet.choices,
        help_text=_("One lap of each in both directions, as they are."),
    )
    tracks = forms.ModelMultipleChoiceField(
        Track.objects.none(),
        to_field_name="slug",
        label=_("Chosen tracks"),
        required=False,
        widget=forms.CheckboxSelectMultiple,
    )
    variations_on = forms.ModelChoiceField(
        Track.objects.none(),
        to_field_name="slug",
        label=_("A hundred variations of a lap of"),
        required=False,
        empty_label=_("none"),
        help_text=_("Other starts, light, colours, sensor noise, and all at once, from mild to strong."),
    )
    direction = forms.ChoiceField(
        label=_("Direction of these laps"),
        required=False,
        choices=[("", _("the track's own")), *Direction.choices],
    )
    seed = forms.IntegerField(
        label=_("Seed"),
        min_value=0,
        max_value=MOST_SEED,
        help_text=_("Another number, other variations; the same number, the same for every car."),
    )

    def __init__(self, data: Any = None, *, racer: Racer | None, initial: dict[str, object] | None = None) -> None:
        usual = {"track_set": TrackSet.LEAGUE.value, "variations_on": USUAL_TRACK, "seed": 0}
        super().__init__(data, initial=usual | (initial or {}))
        self.fields["model"].widget.choices = [
            ("", _("Choose a model")),
            *(cars_of(racer, self["model"].value()) if racer is not None else ()),
        ]
        shaped = all_tracks().filter(length_m__isnull=False)
        for name, offered in (("tracks", shaped), ("variations_on", shaped.filter(is_open=False))):
            field = self.fields[name]
            assert isinstance(field, forms.ModelChoiceField), "both choose among tracks"
            field.queryset = offered.order_by("name")

    def clean(self) -> None:
        """Ticked tracks count for chosen tracks alone."""
        if self.cleaned_data.get("track_set") != TrackSet.CHOSEN:
            self.cleaned_data["tracks"] = []

    def values(self, racer: Racer) -> dict[str, Any]:
        chosen = self.cleaned_data
        return {**chosen, "model": reportable_model(racer, chosen["model"]), "tracks": list(chosen["tracks"])}

    def show(self, fault: UserFault) -> None:
        add_fault(self, fault, _FIELDS.get(fault.code))

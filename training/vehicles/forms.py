"""The form of a vehicle."""

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from evaluation.appearance.looks import Shell
from evaluation.templatetags.garage import SENSOR_WORDS
from paddock.packages.inputs import IN_STEPS, LIDAR_DEFAULTS, LIDARS
from races.models.sensors import CAMERAS
from races.rules.form_fields import PlainNumberField
from training.models import NeuralNetwork, Vehicle
from training.vehicles.services import VehicleValues

CAMERAS_OFFERED = [name for name in CAMERAS if name != "LEFT_CAMERA"]


class VehicleForm(forms.Form):
    """A vehicle: what it sees with, thinks with and looks like."""

    name = forms.CharField(label=_("Name"), max_length=64)
    camera = forms.ChoiceField(
        label=_("Camera"),
        choices=[(name, _(SENSOR_WORDS[name])) for name in CAMERAS_OFFERED],
        widget=forms.RadioSelect,
        help_text=_("One camera is enough to keep to the road. Two see how far away things are."),
    )
    lidar = forms.ChoiceField(
        label=_("Lidar"),
        choices=[("", _("none")), *((name, _(SENSOR_WORDS[name])) for name in LIDARS)],
        widget=forms.RadioSelect,
        required=False,
        help_text=_("Sees boxes and cars around the vehicle. It does not see the road."),
    )
    num_sectors = forms.TypedChoiceField(
        label=_("Sectors"),
        choices=[(n, n) for n in (2, 4, 8, 16, 32, 64)],
        coerce=int,
        empty_value=8,  # type: ignore[arg-type]  # of the type that the field gives
        required=False,
    )
    num_values_per_sector = forms.IntegerField(label=_("Steps in a sector"), min_value=1, max_value=64, required=False)
    clipping_dist = PlainNumberField(label=_("Sees as far as (m)"), min_value=0.15, max_value=12, required=False)
    neural_network = forms.ChoiceField(
        label=_("Network"),
        choices=NeuralNetwork.choices,
        widget=forms.RadioSelect,
        help_text=_("A deeper network can tell more apart and learns more slowly. Begin with the shallow one."),
    )
    shell = forms.ChoiceField(label=_("Shell"), choices=Shell.choices, widget=forms.RadioSelect)
    colour = forms.RegexField(
        label=_("Colour"),
        regex=r"^#[0-9a-fA-F]{6}\Z",
        widget=forms.TextInput(attrs={"type": "color"}),
        error_messages={"invalid": _("Enter a colour as #rrggbb, such as #3b82f6.")},
    )

    def __init__(self, *args: Any, vehicle: Vehicle | None = None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs | {"initial": _initial(vehicle or Vehicle())})

    def values(self) -> VehicleValues:
        data = self.cleaned_data
        in_steps = data["lidar"] == IN_STEPS
        return {
            "name": data["name"],
            "sensors": [name for name in (data["camera"], data["lidar"]) if name],
            "lidar_config": {key: data[key] or usual for key, usual in LIDAR_DEFAULTS.items()} if in_steps else {},
            "neural_network": data["neural_network"],
            "shell": data["shell"],
            "colour": data["colour"].lower(),
        }


def _initial(vehicle: Vehicle) -> dict[str, object]:
    return {
        "name": vehicle.name,
        "camera": next((name for name in vehicle.sensors if name in CAMERAS), ""),
        "lidar": next((name for name in vehicle.sensors if name in LIDARS), ""),
        "neural_network": vehicle.neural_network,
        "shell": vehicle.shell,
        "colour": vehicle.colour,
        **LIDAR_DEFAULTS,
        **vehicle.lidar_config,
    }

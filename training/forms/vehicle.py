"""The form of a vehicle."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from evaluation.looks import DEFAULT_COLOUR, Shell
from evaluation.templatetags.garage import SENSOR_WORDS
from races.fields import PlainNumberField
from races.sensors import CAMERAS
from training.models import NeuralNetwork, Vehicle

CAMERAS_OFFERED = [name for name in CAMERAS if name != "LEFT_CAMERA"]
LIDARS = ("LIDAR", "SECTOR_LIDAR", "DISCRETIZED_SECTOR_LIDAR")
IN_STEPS = "DISCRETIZED_SECTOR_LIDAR"
# model_metadata.json, lidar_config: 64 beams are divisible by the sectors (deepracer-simapp)
LIDAR_DEFAULTS = {"num_sectors": 8, "num_values_per_sector": 8, "clipping_dist": 2.0}


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
        """``vehicle``: the one that is changed, None for a new one."""
        super().__init__(*args, **kwargs | {"initial": _initial(vehicle)})

    def values(self) -> dict[str, Any]:
        """The vehicle's fields, for :func:`training.vehicles.save_vehicle`."""
        said = self.cleaned_data
        in_steps = said["lidar"] == IN_STEPS
        return {
            "name": said["name"],
            "sensors": [name for name in (said["camera"], said["lidar"]) if name],
            "lidar_config": {key: said[key] or usual for key, usual in LIDAR_DEFAULTS.items()} if in_steps else {},
            "neural_network": said["neural_network"],
            "shell": said["shell"],
            "colour": said["colour"].lower(),
        }


def _initial(vehicle: Vehicle | None) -> dict[str, Any]:
    if vehicle is None:
        return {
            "camera": CAMERAS_OFFERED[0],
            "lidar": "",
            "neural_network": NeuralNetwork.SHALLOW,
            "shell": Shell.PADDOCK,
            "colour": DEFAULT_COLOUR,
            **LIDAR_DEFAULTS,
        }
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

"""Vehicles of the garage: list, create, change, delete. Only the owner has access."""

from typing import Any, TypedDict

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from rest_framework import serializers
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import TRAIN
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import PrivateView
from evaluation.appearance.looks import Shell
from paddock.errors import UserFault
from paddock.packages.inputs import IN_STEPS, LIDARS, lidar_settings
from training.models import NeuralNetwork, Vehicle
from training.vehicles.forms import CAMERAS_OFFERED, VehicleForm
from training.vehicles.services import VehicleValues, delete_vehicle, save_vehicle, vehicles_of

SENSORS = [*CAMERAS_OFFERED, *LIDARS]
# the form's own bounds: one source for pages and programs
_FIELDS: dict[str, Any] = VehicleForm.base_fields
SECTORS = [value for value, _label in _FIELDS["num_sectors"].choices]


def _bounds(name: str) -> dict[str, Any]:
    field = _FIELDS[name]
    return {"min_value": field.min_value, "max_value": field.max_value}


class LidarSerializer(Body):
    """How a sector lidar in steps sees; what is left out is as usual."""

    num_sectors = serializers.ChoiceField(SECTORS, required=False)
    num_values_per_sector = serializers.IntegerField(required=False, **_bounds("num_values_per_sector"))
    clipping_dist = serializers.FloatField(required=False, help_text="m", **_bounds("clipping_dist"))


class VehicleSerializer(serializers.Serializer):
    """A vehicle."""

    public_id = serializers.CharField()
    name = serializers.CharField()
    sensors = serializers.ListField(child=serializers.ChoiceField(SENSORS))
    lidar_config = serializers.DictField(help_text="Of the sector lidar in steps; empty without one.")
    neural_network = serializers.ChoiceField(NeuralNetwork.choices)
    shell = serializers.ChoiceField(Shell.choices)
    colour = serializers.CharField(help_text="#rrggbb")
    created_at = serializers.DateTimeField()


class SentVehicle(TypedDict, total=False):
    name: str
    sensors: list[str]
    lidar_config: dict[str, float]
    neural_network: str
    shell: str
    colour: str


class VehicleBody(Body):
    """What a vehicle is made of. What is left out is as usual, or as it was."""

    name = serializers.CharField(max_length=64)
    sensors = serializers.ListField(
        child=serializers.ChoiceField(SENSORS),
        required=False,
        max_length=2,
        help_text="One camera, and a lidar if it shall have one.",
    )
    lidar_config = LidarSerializer(required=False, help_text=f"For the sensor {IN_STEPS}.")
    neural_network = serializers.ChoiceField(NeuralNetwork.choices, required=False)
    shell = serializers.ChoiceField(Shell.choices, required=False)
    colour = serializers.RegexField(r"^#[0-9a-fA-F]{6}\Z", required=False, help_text="#rrggbb")

    def validate_sensors(self, sensors: list[str]) -> list[str]:
        """The camera first. Raises UserFault("vehicle_sensors") for anything but one, and at most one lidar."""
        cameras, lidars = ([name for name in sensors if name in kind] for kind in (CAMERAS_OFFERED, LIDARS))
        if len(cameras) != 1 or len(lidars) > 1:
            raise UserFault("vehicle_sensors", cameras=", ".join(CAMERAS_OFFERED), lidars=", ".join(LIDARS))
        return cameras + lidars


class VehiclesView(PrivateView):
    token_scope = TRAIN

    @operation("list_vehicles", "My vehicles, by name", answer=VehicleSerializer, paged=True)
    def get(self, request: Request) -> QuerySet[Vehicle]:
        return vehicles_of(request.user)

    @operation("add_vehicle", "Add a vehicle", body=VehicleBody, answer=VehicleSerializer, status=201)
    def post(self, request: Request, sent: SentVehicle) -> Vehicle:
        return save_vehicle(owner=racer_of(request), **_values(sent, Vehicle()))


def own_vehicle(request: Request, public_id: str) -> Vehicle:
    return get_object_or_404(vehicles_of(request.user), public_id=public_id)


class VehicleView(PrivateView):
    token_scope = TRAIN

    @operation("read_vehicle", "A vehicle", find=own_vehicle, answer=VehicleSerializer)
    def get(self, request: Request, vehicle: Vehicle) -> Vehicle:
        return vehicle

    @operation(
        "change_vehicle",
        "Change a vehicle",
        find=own_vehicle,
        body=VehicleBody,
        partial=True,
        answer=VehicleSerializer,
        description="What was trained with it stays as it is.",
    )
    def patch(self, request: Request, vehicle: Vehicle, sent: SentVehicle) -> Vehicle:
        return save_vehicle(owner=racer_of(request), vehicle=vehicle, **_values(sent, vehicle))

    @operation("delete_vehicle", "Delete a vehicle", find=own_vehicle, answer="Models that were trained with it stay.")
    def delete(self, request: Request, vehicle: Vehicle) -> None:
        delete_vehicle(vehicle=vehicle)


def _values(sent: SentVehicle, before: Vehicle) -> VehicleValues:
    """Keyword arguments of ``save_vehicle``: the sent values, completed from the vehicle. Raises UserFault
    ``vehicle_lidar``."""
    sensors = sent.get("sensors", before.sensors)
    lidar = sent.get("lidar_config", {})
    if IN_STEPS in sensors:
        lidar = lidar_settings(before.lidar_config | lidar)
    elif lidar:
        raise UserFault("vehicle_lidar", sensor=IN_STEPS)
    return {
        "name": sent.get("name", before.name),
        "sensors": sensors,
        "lidar_config": lidar,
        "neural_network": sent.get("neural_network", before.neural_network),
        "shell": sent.get("shell", before.shell),
        "colour": sent.get("colour", before.colour).lower(),
    }

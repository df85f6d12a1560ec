"""Vehicles of the garage: list, create, change, delete. Only the owner has access."""

from typing import Any

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from drf_spectacular.utils import OpenApiResponse, extend_schema, extend_schema_view
from rest_framework import serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import TRAIN
from core.api.bodies import Body, read_as
from core.api.finding import finds
from core.api.views import APIView, ListAPIView
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


@extend_schema_view(get=extend_schema(operation_id="list_vehicles", summary="My vehicles, by name"))
class VehiclesView(ListAPIView):
    token_scope = TRAIN
    permission_classes = [IsAuthenticated]
    serializer_class = VehicleSerializer

    def get_queryset(self) -> QuerySet[Vehicle]:
        return vehicles_of(self.request.user)

    @extend_schema(
        operation_id="add_vehicle",
        summary="Add a vehicle",
        request=VehicleBody,
        responses={201: VehicleSerializer},
    )
    def post(self, request: Request) -> Response:
        vehicle = save_vehicle(owner=racer_of(request), **_values(request, Vehicle(), partial=False))
        return Response(VehicleSerializer(vehicle).data, status=status.HTTP_201_CREATED)


def own_vehicle(request: Request, public_id: str) -> Vehicle:
    return get_object_or_404(vehicles_of(request.user), public_id=public_id)


class VehicleView(APIView):
    token_scope = TRAIN
    permission_classes = [IsAuthenticated]

    @extend_schema(operation_id="read_vehicle", summary="A vehicle", responses=VehicleSerializer)
    @finds(own_vehicle)
    def get(self, request: Request, vehicle: Vehicle) -> Response:
        return Response(VehicleSerializer(vehicle).data)

    @extend_schema(
        operation_id="change_vehicle",
        summary="Change a vehicle",
        description="What was trained with it stays as it is.",
        request=VehicleBody,
        responses=VehicleSerializer,
    )
    @finds(own_vehicle)
    def patch(self, request: Request, vehicle: Vehicle) -> Response:
        values = _values(request, vehicle, partial=True)
        return Response(VehicleSerializer(save_vehicle(owner=racer_of(request), vehicle=vehicle, **values)).data)

    @extend_schema(
        operation_id="delete_vehicle",
        summary="Delete a vehicle",
        responses={204: OpenApiResponse(description="Models that were trained with it stay.")},
    )
    @finds(own_vehicle, fields=False)
    def delete(self, request: Request, vehicle: Vehicle) -> Response:
        delete_vehicle(vehicle=vehicle)
        return Response(status=status.HTTP_204_NO_CONTENT)


def _values(request: Request, before: Vehicle, *, partial: bool) -> VehicleValues:
    """Keyword arguments of ``save_vehicle``: the sent values, completed from the vehicle. Raises ValidationError,
    UserFault ``vehicle_sensors``, ``vehicle_lidar``."""
    sent = read_as(VehicleBody, request.data, partial=partial)
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

"""Vehicles of the garage: list, add, change, delete. A vehicle is its owner's and nobody else's."""

from __future__ import annotations

from typing import Any

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from drf_spectacular.utils import OpenApiResponse, extend_schema, extend_schema_view
from rest_framework import generics, serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import TRAIN
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields
from evaluation.looks import DEFAULT_COLOUR, Shell
from paddock.errors import UserFault
from training.forms.vehicle import CAMERAS_OFFERED, IN_STEPS, LIDAR_DEFAULTS, LIDARS, VehicleForm
from training.models import NeuralNetwork, Vehicle
from training.models.vehicle import default_sensors
from training.vehicles import delete_vehicle, save_vehicle, vehicles_of

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


@extend_schema_view(
    get=extend_schema(
        operation_id="list_vehicles", summary="My vehicles, by name", responses=VehicleSerializer, tags=["vehicles"]
    )
)
class VehiclesView(generics.ListAPIView):
    """A racer's vehicles: list them, add one."""

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
        tags=["vehicles"],
    )
    def post(self, request: Request) -> Response:
        usual = Vehicle(sensors=default_sensors(), shell=Shell.PADDOCK, colour=DEFAULT_COLOUR)
        vehicle = save_vehicle(owner=racer_of(request), **_values(request, usual, partial=False))
        return Response(VehicleSerializer(vehicle).data, status=status.HTTP_201_CREATED)


class VehicleView(APIView):
    """One of my vehicles."""

    token_scope = TRAIN
    permission_classes = [IsAuthenticated]

    @extend_schema(operation_id="read_vehicle", summary="A vehicle", responses=VehicleSerializer, tags=["vehicles"])
    def get(self, request: Request, public_id: str) -> Response:
        return Response(VehicleSerializer(self._vehicle(public_id)).data)

    @extend_schema(
        operation_id="change_vehicle",
        summary="Change a vehicle",
        description="What was trained with it stays as it is.",
        request=VehicleBody,
        responses=VehicleSerializer,
        tags=["vehicles"],
    )
    def patch(self, request: Request, public_id: str) -> Response:
        vehicle = self._vehicle(public_id)
        values = _values(request, vehicle, partial=True)
        return Response(VehicleSerializer(save_vehicle(owner=racer_of(request), vehicle=vehicle, **values)).data)

    @extend_schema(
        operation_id="delete_vehicle",
        summary="Delete a vehicle",
        request=None,
        responses={204: OpenApiResponse(description="Models that were trained with it stay.")},
        tags=["vehicles"],
    )
    def delete(self, request: Request, public_id: str) -> Response:
        refuse_fields(request)
        delete_vehicle(vehicle=self._vehicle(public_id))
        return Response(status=status.HTTP_204_NO_CONTENT)

    def _vehicle(self, public_id: str) -> Vehicle:
        return get_object_or_404(vehicles_of(self.request.user), public_id=public_id)


def _values(request: Request, before: Vehicle, *, partial: bool) -> dict[str, Any]:
    """Keyword arguments of ``save_vehicle``: what is sent, and beside it what the vehicle had.

    Raises ValidationError, UserFault("vehicle_sensors" | "vehicle_lidar").
    """
    sent = read_as(VehicleBody, request.data, partial=partial)
    sensors = sent.get("sensors", before.sensors)
    lidar = sent.get("lidar_config", {})
    if IN_STEPS in sensors:
        lidar = LIDAR_DEFAULTS | before.lidar_config | lidar
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

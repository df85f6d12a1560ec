"""Writes and lists of a racer's vehicles."""

from collections.abc import Mapping
from typing import TypedDict, Unpack

from django.contrib.auth.models import AnonymousUser
from django.db import transaction
from django.db.models import QuerySet

from accounts.models import Racer
from core.database.locks import hold
from evaluation.models import TrainedModel
from paddock.errors import UserFault

from ..models import Vehicle

VEHICLES_PER_RACER = 50


class VehicleValues(TypedDict):
    """The columns that a racer chooses."""

    name: str
    sensors: list[str]
    lidar_config: Mapping[str, float]
    neural_network: str
    shell: str
    colour: str


def vehicles_of(racer: Racer | AnonymousUser) -> QuerySet[Vehicle]:
    """The racer's vehicles by name; none for somebody who is not logged in."""
    return Vehicle.objects.filter(owner_id=racer.pk)


@transaction.atomic
def save_vehicle(*, owner: Racer, vehicle: Vehicle | None = None, **values: Unpack[VehicleValues]) -> Vehicle:
    """Add a vehicle, or change ``vehicle``. Raises UserFault ``vehicle_name_taken``, ``vehicle_limit``."""
    hold(owner)
    mine = vehicles_of(owner)
    if vehicle is None:
        if mine.count() >= VEHICLES_PER_RACER:
            raise UserFault("vehicle_limit", limit=VEHICLES_PER_RACER)
        vehicle = Vehicle(owner=owner)
    if mine.filter(name=values["name"]).exclude(pk=vehicle.pk).exists():
        raise UserFault("vehicle_name_taken", name=values["name"])
    for name, value in values.items():
        setattr(vehicle, name, value)
    vehicle.save()
    return vehicle


def delete_vehicle(*, vehicle: Vehicle) -> None:
    """Take a vehicle out of the garage. What was trained with it keeps its copy."""
    vehicle.delete()


def vehicle_like(model: TrainedModel) -> Vehicle:
    metadata = model.metadata
    return Vehicle(
        name=model.name,
        sensors=model.sensors,
        lidar_config=metadata.get("lidar_config", {}),
        neural_network=metadata["neural_network"],
        shell=model.shell,
        colour=model.colour,
    )

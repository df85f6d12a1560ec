"""Models whose weights a training can start from."""

from collections.abc import Mapping
from typing import Any

from core.streams.shared_pieces import shared_value
from evaluation.models import TrainedModel
from paddock.packages.inputs import IN_STEPS, lidar_settings
from paddock.packages.metadata import DISCRETE

from ..models import Algorithm, Vehicle
from ..trainer.network import build_of


def build_of_model(model: TrainedModel) -> str | None:
    """A name of :data:`training.trainer.network.BUILDS`, derived from the number of weights; None: not trainable here.
    The trainer, which alone reads an uploaded file, reports a wrong guess."""
    if model.metadata.get("frame_stack", 1) > 1:  # trainings here read one observation at a time
        return None
    return build_of(model.metadata, model.network.parameters)


def house_cars() -> list[TrainedModel]:
    """The house's own models that a training can begin with, by their names: one query for all readers."""
    return shared_value(("house cars",), _house_cars)


def _house_cars() -> list[TrainedModel]:
    models = TrainedModel.objects.filter(owner__is_house=True, owner__is_active=True, deleted_at=None)
    found = models.select_related("network").order_by("name", "pk")[:12]
    return [model for model in found if build_of_model(model)][:4]


def fits(vehicle: Vehicle, metadata: Mapping[str, Any]) -> bool:
    """Whether a training with this vehicle can begin with the weights of a model of this metadata."""
    if set(vehicle.sensors) != set(metadata["sensor"]) or vehicle.neural_network != metadata.get("neural_network"):
        return False
    in_steps = IN_STEPS in metadata["sensor"]
    return not in_steps or lidar_settings(vehicle.lidar_config) == lidar_settings(metadata.get("lidar_config"))


def house_car_for(vehicle: Vehicle, algorithm: str, action_space_type: str, action_space: Any) -> TrainedModel | None:
    """The first house car that drives as this car at once: trained by PPO, with the same sensors and network, and with
    actions that steer to the same sides. None where there is none."""
    if algorithm != Algorithm.PPO:
        return None
    wanted = {"action_space_type": action_space_type, "action_space": action_space}
    cars = (model for model in house_cars() if fits(vehicle, model.metadata))
    return next((model for model in cars if _sides(model.metadata) == _sides(wanted)), None)


def _sides(metadata: Mapping[str, Any]) -> list[int] | None:
    """For each discrete action -1 (right), 0 (straight) or 1 (left); None for ranges."""
    if metadata.get("action_space_type", DISCRETE) != DISCRETE:
        return None
    angles = [action["steering_angle"] for action in metadata["action_space"]]
    return [(angle > 0) - (angle < 0) for angle in angles]

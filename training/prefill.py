"""What the wizard proposes: for the query of its address, which lessons and buttons write."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from evaluation.models import TrainedModel
from paddock.packages.inputs import lidar_settings
from paddock.rules.hyperparameters import DEFAULTS, HYPERPARAMETERS, PPO, SAC
from paddock.rules.training import DRIVEN_BY, ENDING, KEPT, RANDOMISED
from races.layout_form import DRAWN, FIXED
from tracks.models import Track

from . import all_round
from .actions import discrete_actions
from .cloning import build_of_model
from .forms.training import CONTINUOUS, DISCRETE, GRANULARITIES, INITIAL
from .lessons import LESSON_CODE
from .models import TrainingJob, Vehicle
from .rewards.examples import DEFAULT, EXAMPLES
from .selectors import clonable_models
from .services.first import free_name
from .trainer.network import CONSOLE
from .vehicles import vehicles_of

if TYPE_CHECKING:
    from accounts.models import Racer

LONGEST = 255
ALL_ROUND = "all-round"
# The console's own (deepracer.md 2.4), at which those cars were trained; ours learn best at three times as much.
CONSOLE_LR = 3e-4
LACKS_VEHICLE = "lacks_vehicle"  # not a field: the model to begin with, where none of the racer's vehicles fits it
TAKEN_OVER = ("track", *DRIVEN_BY, "algorithm", "action_space_type", "reward_code", *KEPT)
# Fields that an address may fill in. Whatever it says is checked when the form is sent, as if it had been typed.
NAMED = (
    *("name", "description", "track", "direction", "race_type", "random_boxes", "bots", "algorithm", "vehicle"),
    *(*HYPERPARAMETERS, "action_space_type", *GRANULARITIES, "steering_low", "steering_high"),
    *("speed_low", "speed_high", *ENDING, "seed", "alternate_direction", *RANDOMISED),
    "submit_to_race",
)


def proposals(owner: Racer, asked: Mapping[str, str]) -> dict[str, Any]:
    """Initial values of the wizard. ``recipe=all-round`` proposes several tracks and what goes with them
    (:mod:`training.all_round`), as far as this site has them. ``job`` takes over the settings of one of the racer's
    trainings, ``clone`` those of a model and its weights, ``example`` a reward function; then come single fields by
    their names."""
    initial: dict[str, Any] = {"reward_code": DEFAULT.code}
    if asked.get("recipe") == ALL_ROUND:
        initial |= _all_round()
    job = TrainingJob.objects.filter(owner=owner, public_id=asked.get("job", "")).select_related("track", "vehicle")
    for one in job:
        initial |= _of_job(one)
    model = clonable_models(owner).filter(public_id=asked.get("clone", "")).first()
    if model is not None:
        initial |= _of_model(owner, model)
        if build_of_model(model) == CONSOLE:
            initial.setdefault("lr", CONSOLE_LR)
    for example in EXAMPLES:
        if example.slug == asked.get("example"):
            initial["reward_code"] = example.code
    initial["reward_code"] = LESSON_CODE.get(asked.get("lesson", ""), initial["reward_code"])
    said = {name: asked[name][:LONGEST] for name in NAMED if asked.get(name)}
    if "name" in said:
        said["name"] = free_name(owner, said["name"])
    initial |= said
    initial = {**DEFAULTS.get(initial.get("algorithm", ""), {}), **initial}
    initial["usual_of"] = initial.get("algorithm", PPO)
    if initial["usual_of"] == SAC:
        initial["action_space_type"] = CONTINUOUS
    if said.keys() & set(GRANULARITIES):
        initial["actions"] = table({**INITIAL, **said})
    return initial


def _all_round() -> dict[str, Any]:
    here = set(Track.objects.filter(slug__in=all_round.TRACKS).exclude(length_m=None).values_list("slug", flat=True))
    slugs = [slug for slug in all_round.TRACKS if slug in here]
    return {**all_round.SETTINGS, **({"track": slugs[0], "more_tracks": slugs[1:]} if slugs else {})}


def table(values: Mapping[str, Any]) -> list[dict[str, float]]:
    """The table of actions that granularities make; where one of them is not a number, the usual one is taken."""
    numbers = []
    for name in GRANULARITIES:
        try:
            numbers.append(type(INITIAL[name])(values.get(name) or INITIAL[name]))
        except (TypeError, ValueError):
            numbers.append(INITIAL[name])
    steering, angles, speed, speeds = numbers
    return discrete_actions(steering, min(max(angles, 2), 15), speed, min(max(speeds, 1), 30 // max(angles, 2)))


def _of_job(job: TrainingJob) -> dict[str, Any]:
    initial: dict[str, Any] = {name: getattr(job, name) for name in TAKEN_OVER}
    initial |= job.hyperparameters | _of_actions(job.action_space)
    initial["track"] = job.track.slug
    initial["more_tracks"] = [track.slug for track in job.tracks[1:]]
    # of a vehicle that is deleted since: another one like it
    initial["vehicle"] = job.vehicle.public_id if job.vehicle else _fitting(job.owner, job.metadata) or ""
    initial["box_choice"] = FIXED if job.boxes else DRAWN
    initial |= {name: INITIAL[name] for name in ("random_boxes", "bots") if not initial[name]}
    return initial


def _of_model(owner: Racer, model: TrainedModel) -> dict[str, Any]:
    """The model's weights, and a vehicle and action space that go with them."""
    metadata = model.metadata
    initial = {"clone": model.public_id, "action_space_type": metadata.get("action_space_type", DISCRETE)}
    initial["algorithm"] = "sac" if metadata.get("training_algorithm") == "sac" else "ppo"
    initial |= _of_actions(metadata["action_space"])
    fitting = _fitting(owner, metadata)
    if fitting is None:
        initial[LACKS_VEHICLE] = model
    else:
        initial["vehicle"] = fitting
    return initial


def _fitting(owner: Racer, metadata: Mapping[str, Any]) -> str | None:
    """What the wizard calls the first vehicle of the racer that goes with a model's metadata, "" for the original car;
    None if there is no such vehicle."""
    cars = [("", Vehicle()), *((vehicle.public_id, vehicle) for vehicle in vehicles_of(owner))]
    return next((name for name, vehicle in cars if fits(vehicle, metadata)), None)


def fits(vehicle: Vehicle, metadata: Mapping[str, Any]) -> bool:
    """Whether a training with this vehicle can begin with the weights of a model of this metadata."""
    if set(vehicle.sensors) != set(metadata["sensor"]) or vehicle.neural_network != metadata.get("neural_network"):
        return False
    in_steps = "DISCRETIZED_SECTOR_LIDAR" in metadata["sensor"]
    return not in_steps or lidar_settings(vehicle.lidar_config) == lidar_settings(metadata.get("lidar_config"))


def vehicle_like(model: TrainedModel) -> Vehicle:
    """A vehicle, not saved, that goes with a model's weights and wears its look."""
    metadata = model.metadata
    return Vehicle(
        name=model.name,
        sensors=model.sensors,
        lidar_config=metadata.get("lidar_config", {}),
        neural_network=metadata["neural_network"],
        shell=model.shell,
        colour=model.colour,
    )


def _of_actions(space: Any) -> dict[str, Any]:
    if isinstance(space, list):
        return {"actions": [{key: float(action[key]) for key in ("steering_angle", "speed")} for action in space]}
    ends = ("low", "high")
    return {
        "action_space_type": CONTINUOUS,
        **{f"steering_{end}": float(space["steering_angle"][end]) for end in ends},
        **{f"speed_{end}": float(space["speed"][end]) for end in ends},
    }

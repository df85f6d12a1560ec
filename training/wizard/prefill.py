"""Initial values of the wizard, from the query of its address."""

from collections.abc import Iterable, Mapping
from typing import Any

from accounts.models import Racer
from evaluation.models import TrainedModel
from evaluation.selectors import visible_model
from paddock.packages.metadata import CONTINUOUS, DISCRETE
from paddock.rules.hyperparameters import DEFAULTS, HYPERPARAMETERS, PPO, SAC
from paddock.rules.race import BOX_COUNT
from paddock.rules.training import DRIVEN_BY, ENDING, KEPT, RANDOMISED
from races.rules.layout_form import DRAWN, FIXED
from tracks.models import Track

from ..cloning.selectors import build_of_model, fits, house_cars
from ..jobs.settings_checks import discrete_actions
from ..lessons.catalogue import LESSON_CODE
from ..models import TrainingJob, Vehicle
from ..rewards.examples import DEFAULT, EXAMPLES
from ..starter_training.services import free_name
from ..trainer.network import CONSOLE
from ..vehicles.services import vehicles_of
from . import all_round
from .fields import OwnRows
from .forms import FROM_HOUSE, FROM_MODEL, FROM_NOTHING, GRANULARITIES, INITIAL

LONGEST = 255
ALL_ROUND = "all-round"
# The console's own (deepracer.md 2.4), at which those cars were trained; ours learn best at three times as much.
CONSOLE_LR = 3e-4
# What an address names whose point is to learn it
LEARNED = ("recipe", "job", "example", "lesson")
LACKS_VEHICLE = "lacks_vehicle"  # not a field: the model to begin with, where none of the racer's vehicles fits it
TAKEN_OVER = ("track", *DRIVEN_BY, "algorithm", "action_space_type", "reward_code", *KEPT)
# Fields that an address may fill in. The values are checked when the form is sent, as if they had been typed.
NAMED = (
    *("name", "description", "track", "direction", "race_type", BOX_COUNT, "bots", "algorithm", "vehicle"),
    *(*HYPERPARAMETERS, "action_space_type", *GRANULARITIES, "steering_low", "steering_high"),
    *("speed_low", "speed_high", *ENDING, "seed", "alternate_direction", *RANDOMISED),
    "submit_to_race",
)


def proposals(owner: Racer, asked: Mapping[str, str], read: OwnRows | None = None) -> dict[str, object]:
    """Initial values of the wizard, which starts from a house car unless the address names something to learn.

    ``recipe=all-round``: :mod:`.all_round`, as far as this site has the tracks.
    ``job``: the settings of a training. ``clone``: a model and its weights. ``example``: a reward function. Fields by
    their names.
    """
    initial: dict[str, Any] = {"reward_code": DEFAULT.code}
    if asked.get("recipe") == ALL_ROUND:
        initial |= _all_round()
    if wanted := asked.get("job"):
        jobs = TrainingJob.objects.filter(owner=owner, public_id=wanted)
        for one in jobs.select_related("track", "vehicle"):
            initial |= _of_job(one)
    wanted = asked.get("clone")
    model = visible_model(owner, wanted) if wanted else None
    if model is not None:
        initial |= _of_model(read or OwnRows(owner), model)
        if build_of_model(model) == CONSOLE:
            initial.setdefault("lr", CONSOLE_LR)
    for example in EXAMPLES:
        if example.slug == asked.get("example"):
            initial["reward_code"] = example.code
    if model is not None:
        initial["start"] = FROM_MODEL
    elif any(asked.get(name) for name in LEARNED) or not house_cars():
        initial["start"] = FROM_NOTHING
    else:
        initial["start"] = FROM_HOUSE
    initial["reward_code"] = LESSON_CODE.get(asked.get("lesson", ""), initial["reward_code"])
    given = {name: asked[name][:LONGEST] for name in NAMED if asked.get(name)}
    if "name" in given:
        given["name"] = free_name(owner, given["name"])
    initial |= given
    initial = {**DEFAULTS.get(initial.get("algorithm", ""), {}), **initial}
    initial["usual_of"] = initial.get("algorithm", PPO)
    if initial["usual_of"] == SAC:
        initial["action_space_type"] = CONTINUOUS
    if given.keys() & set(GRANULARITIES):
        initial["actions"] = table({**INITIAL, **given})
    return initial


def _all_round() -> dict[str, object]:
    here = set(Track.objects.filter(slug__in=all_round.TRACKS).exclude(length_m=None).values_list("slug", flat=True))
    slugs = [slug for slug in all_round.TRACKS if slug in here]
    return {**all_round.SETTINGS, **({"track": slugs[0], "more_tracks": slugs[1:]} if slugs else {})}


def table(values: Mapping[str, Any]) -> list[dict[str, float]]:
    """The table of actions that granularities make; where one of them is not a number, the usual one is taken."""
    numbers: list[Any] = []
    for name, usual in GRANULARITIES.items():
        try:
            numbers.append(type(usual)(values.get(name) or usual))
        except (TypeError, ValueError):
            numbers.append(usual)
    steering, angles, speed, speeds = numbers
    return discrete_actions(steering, min(max(angles, 2), 15), speed, min(max(speeds, 1), 30 // max(angles, 2)))


def _of_job(job: TrainingJob) -> dict[str, object]:
    initial = {name: getattr(job, name) for name in TAKEN_OVER}
    initial |= job.hyperparameters | _of_actions(job.action_space)
    initial["track"] = job.track.slug
    initial["more_tracks"] = [track.slug for track in job.tracks[1:]]
    # of a vehicle that is deleted since: another one like it
    initial["vehicle"] = job.vehicle.public_id if job.vehicle else _fitting(vehicles_of(job.owner), job.metadata) or ""
    initial["box_choice"] = FIXED if job.boxes else DRAWN
    initial |= {name: INITIAL[name] for name in (BOX_COUNT, "bots") if not initial[name]}
    return initial


def _of_model(own: OwnRows, model: TrainedModel) -> dict[str, object]:
    metadata = model.metadata
    initial = {"clone": model.public_id, "action_space_type": metadata.get("action_space_type", DISCRETE)}
    initial["algorithm"] = "sac" if metadata.get("training_algorithm") == "sac" else "ppo"
    initial |= _of_actions(metadata["action_space"])
    fitting = _fitting(own.vehicles, metadata)
    if fitting is None:
        initial[LACKS_VEHICLE] = model
    else:
        initial["vehicle"] = fitting
    return initial


def _fitting(vehicles: Iterable[Vehicle], metadata: Mapping[str, Any]) -> str | None:
    """The wizard's value of the first vehicle that fits a model's metadata, "" for the original car; or
    None."""
    cars = [("", Vehicle()), *((vehicle.public_id, vehicle) for vehicle in vehicles)]
    return next((name for name, vehicle in cars if fits(vehicle, metadata)), None)


def _of_actions(space: Any) -> dict[str, object]:
    if isinstance(space, list):
        return {"actions": [{key: float(action[key]) for key in ("steering_angle", "speed")} for action in space]}
    ends = ("low", "high")
    return {
        "action_space_type": CONTINUOUS,
        **{f"steering_{end}": float(space["steering_angle"][end]) for end in ends},
        **{f"speed_{end}": float(space["speed"][end]) for end in ends},
    }

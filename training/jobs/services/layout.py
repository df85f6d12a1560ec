"""The rules of a training's track: boxes, bots, starts."""

from collections.abc import Sequence
from typing import Any

from paddock.errors import UserFault
from paddock.rules.race import BOTS_DRIVING, BOX_COUNT, RaceRules, other_direction
from paddock.simulator.layout import lay_out
from races.models import RaceType
from tracks.models import Track

from ...models import TrainingJob

LAPS_OF_A_TEST = 3


def check_layout(job: TrainingJob, more_tracks: Sequence[Track] = ()) -> None:
    """Check that boxes and bots match the race type and fit on each track in each direction. Raises UserFault."""
    if job.race_type == RaceType.HEAD_TO_HEAD and not job.bots:
        raise UserFault("training_course", problem="no bot cars")
    try:
        rules = RaceRules.from_dict({**layout_of(job), "race_type": job.race_type, "direction": job.direction})
    except (ValueError, TypeError) as error:
        raise UserFault("training_course", problem=str(error)[:200]) from None
    directions = (job.direction, *([other_direction(job.direction)] if job.alternate_direction else []))
    for track in (job.track, *more_tracks):
        if not track.has_shape:
            raise UserFault("race_track_without_shape", track=track.name)
        for direction in directions:
            lay_out(track.geometry.in_direction(direction), rules)


# Passed only if not the default: during an upgrade an older trainer does not know them.
_CHANGES = ("bot_lane_change_m", "bot_lane_change_least_ms", "bot_lane_change_most_ms")


def layout_of(job: TrainingJob) -> dict[str, Any]:
    """The rules of boxes, bots and standing starts as the race type's environment takes them."""
    layout: dict[str, Any] = {}
    if job.boxes or job.random_boxes:
        layout |= {name: getattr(job, name) for name in ("boxes", BOX_COUNT)}
    if job.bots:
        layout |= {name: getattr(job, name) for name in BOTS_DRIVING}
        layout |= {name: getattr(job, name) for name in _CHANGES if getattr(job, name) != getattr(RaceRules, name)}
    if job.standing_laps:
        layout["standing_laps"] = True
    return layout


def options_of_a_test(job: TrainingJob) -> dict[str, Any]:
    """How a model of this training is tried: three laps among what it was trained among, in the same direction."""
    options = {**layout_of(job), "race_type": job.race_type, "direction": job.direction, "laps": LAPS_OF_A_TEST}
    return options | ({"seed": job.seed} if job.random_boxes or job.bots else {})

"""The sensors that a race can offer, and their match with a model's."""

from collections.abc import Iterable

from paddock.errors import UserFault
from paddock.packages import inputs

# deepracer-simapp, sensors/sensors_rollout.py: "observation" is the name of the one camera in the oldest models.
SAME_AS = {"observation": "FRONT_FACING_CAMERA"}
CAMERAS = tuple(name for name in inputs.CAMERAS if name not in SAME_AS)
OFFERABLE = (*CAMERAS, *inputs.LIDARS)


def sensors_make_sense(sensors: object) -> bool:
    """Whether a race may offer this: a list of different names of :data:`OFFERABLE` with a camera."""
    return (
        isinstance(sensors, list)
        and all(isinstance(name, str) and name in OFFERABLE for name in sensors)
        and any(name in CAMERAS for name in sensors)
        and len(set(sensors)) == len(sensors)
    )


def not_offered(reads: Iterable[str], offered: Iterable[str]) -> list[str]:
    """The sensors that a model reads and a race does not offer, in the model's order."""
    offered = set(offered)
    return [name for name in reads if SAME_AS.get(name, name) not in offered]


def require_offered(reads: Iterable[str], offered: Iterable[str]) -> None:
    """Raises UserFault("sensors_not_offered") for a model that reads what a race does not offer."""
    if missing := not_offered(reads, offered):
        raise UserFault("sensors_not_offered", needed=", ".join(missing), offered=", ".join(offered))

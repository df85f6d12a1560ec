"""The proposed settings of a training for a car that drives on all tracks; ``benchmarks/generalist.py`` measures it."""

from collections.abc import Mapping
from typing import Any

# Eight short tracks that differ: wide and narrow, round and winding; with bends to both sides, for it goes both ways.
TRACKS = (
    *("oval", "a-to-z-speedway", "reinvent-2018", "smile-speedway"),
    *("aws-summit-raceway", "rl-speedway", "cumulo-carrera-training", "vivalas-loop"),
)
SETTINGS: Mapping[str, Any] = {
    "alternate_direction": True,
    "random_light": 30,
    "random_colours": 20,
    "random_start": 30,
    "stop_minutes": 15,
    "trials": 10,
}

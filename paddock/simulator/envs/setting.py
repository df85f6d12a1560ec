"""The parts of an environment, for one car and for many."""

import dataclasses
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.packages.metadata import ModelMetadata, parse_metadata
from paddock.rules.race import (
    HEAD_TO_HEAD,
    OBJECT_AVOIDANCE,
    PROPOSED_BOXES,
    TIME_TRIAL,
    BoxPlace,
    RaceRules,
    other_direction,
)

from ..action import DISCRETE, ActionSpace
from ..camera.theme import Theme
from ..layout import lay_out
from ..physics import CarPhysics
from ..randomisation import NOTHING, Randomisation
from ..rewards import RewardFunction
from ..sensors import sensor_spec
from ..stage import PreparedTrack
from .configuration import BOX, DICT, OBSERVATIONS, RANDOM, RGB, STARTS, default_config, rules_of_episodes

OPEN_ROOM_M = 1.0  # the least distance of a start from the end of an open track

_DERIVED = ("direction", "random_boxes")  # their defaults depend on ``track`` and on ``boxes``

Track = TrackGeometry | str | os.PathLike[str]
Readings = dict[str, np.ndarray]


@dataclass(frozen=True)
class Setting:
    """Track, rules, car and reward of an environment, made by :func:`time_trial`, :func:`object_avoidance` and
    :func:`head_to_head`. ``ways``: of each track the requested direction, and the other one where episodes alternate;
    empty for ``ground`` alone."""

    ground: PreparedTrack
    rules: RaceRules
    metadata: ModelMetadata
    actions: ActionSpace
    physics: CarPhysics
    random_start: bool
    layout_seed: int | None
    reward_function: RewardFunction
    observation: str = DICT
    randomise: Randomisation = NOTHING
    ways: tuple[tuple[PreparedTrack, ...], ...] = ()

    def ground_of(self, episode: int, rng: np.random.Generator) -> PreparedTrack:
        """The track of a car's episode, counted from 0: drawn, its ways by turns."""
        if not self.ways:
            return self.ground
        ways = self.ways[int(rng.integers(len(self.ways)))] if len(self.ways) > 1 else self.ways[0]
        return ways[episode % len(ways)]

    @property
    def sensors(self) -> tuple[str, ...]:
        return tuple(sorted(self.metadata.sensors))

    @property
    def boxes(self) -> dict[str, spaces.Box]:
        """The space of each sensor: cameras uint8 (120, 160, channels), lidars a row of float32."""
        specs = (sensor_spec(name, self.metadata.lidar_config) for name in self.sensors)
        return {spec.name: spaces.Box(spec.low, spec.high, spec.shape, np.dtype(spec.dtype).type) for spec in specs}

    @property
    def observation_space(self) -> spaces.Dict | spaces.Box:
        """The observations of an agent: all :attr:`boxes`, or the only sensor's."""
        if self.observation == DICT:
            return spaces.Dict(dict(self.boxes))
        box = self.boxes[self.sensors[0]]
        if self.observation == BOX:
            return box
        return spaces.Box(0, 255, (*box.shape[:2], 3), np.uint8)

    def present(self, readings: Readings) -> Readings | np.ndarray:
        """Readings of one car, or of many with the car first, in the form of :attr:`observation_space`."""
        if self.observation == DICT:
            return readings
        reading = readings[self.sensors[0]]
        return reading if self.observation == BOX else np.repeat(reading, 3, axis=-1)

    @property
    def action_space(self) -> spaces.Discrete | spaces.Box:
        """An index into the list, or two values in [-1, 1] for steering and speed."""
        if self.actions.kind == DISCRETE:
            return spaces.Discrete(self.actions.size)
        return spaces.Box(-1.0, 1.0, (self.actions.size,), np.float32)

    def start_m(
        self, rng: np.random.Generator, options: Mapping[str, Any], ground: PreparedTrack | None = None
    ) -> float:
        """The start of an episode on ``ground``, metres after the finish line. ``options["start_m"]``: metres, or a
        function of track and ``rng`` that returns them or None."""
        track = (ground or self.ground).track
        last = track.length - OPEN_ROOM_M if track.is_open else track.length
        asked = options.get("start_m")
        drawn = callable(asked)
        if callable(asked):
            asked = asked(track, rng)
        if asked is not None:
            start = float(asked)
            if not math.isfinite(start):
                raise ValueError(f"start_m must be a finite number of metres, not {start}")
            if track.is_open and not 0.0 <= start <= last:
                raise ValueError(f"start_m on this open track must be 0 to {last:.2f}, not {start}")
            if not drawn and not 0.0 <= start < track.length:
                raise ValueError(f"start_m on this track must be at least 0 and below {last:.2f}, not {start}")
            return start
        return float(rng.uniform(0.0, last)) if self.random_start else self.rules.start_m

    def episode_rules(self, rng: np.random.Generator) -> RaceRules:
        """The rules of one episode, with a new seed for boxes and bots unless ``layout_seed`` fixes it."""
        if not self.draws_layout:
            return self.rules
        return dataclasses.replace(self.rules, seed=int(rng.integers(0, 2**31)))

    @property
    def draws_layout(self) -> bool:
        return self.rules.race_type != TIME_TRIAL and self.layout_seed is None


def time_trial(**options: Any) -> Setting:
    """Laps alone; ``options``: see :func:`race_setting`."""
    return race_setting(TIME_TRIAL, **options)


def object_avoidance(**options: Any) -> Setting:
    """Laps past ``boxes`` at fixed places (fraction, lane), or past ``random_boxes`` drawn in every episode from the
    seed of ``reset``, or from ``layout_seed``. ``options``: see :func:`race_setting`."""
    return race_setting(OBJECT_AVOIDANCE, **options)


def head_to_head(**options: Any) -> Setting:
    """Laps among bots, whose lanes are drawn as the boxes of :func:`object_avoidance`. ``options``: see
    :func:`race_setting`."""
    setting = race_setting(HEAD_TO_HEAD, **options)
    if not setting.rules.bots:
        raise ValueError("bots must be at least 1: other models do not drive in an environment")
    return setting


def race_setting(race_type: str, *, config: Mapping[str, Any] | None = None, **options: Any) -> Setting:
    """The environment of :func:`.configuration.default_config`, changed by ``config`` and then by ``options``.

    ``config`` may be a whole default configuration with some entries changed: its direction then still follows the name
    of the track, and fixed boxes still replace drawn ones.

    Raises TypeError for an option or rule that this type of race does not have, ValueError for an invalid value or
    metadata, UserFault for an invalid track file or layout.
    """
    values = default_config(race_type)
    config = {name: value for name, value in (config or {}).items() if name not in _DERIVED or value != values[name]}
    changes = {**config, **options}
    if unknown := changes.keys() - values.keys():
        rules_known = ", ".join(rules_of_episodes(race_type))
        raise TypeError(f"{race_type} takes no {', '.join(sorted(unknown))}; its rules are {rules_known}")
    if race_type == OBJECT_AVOIDANCE:
        changes |= _boxes(changes)
    values |= changes
    track, theme, layout_seed = values["track"], values["theme"], values["layout_seed"]
    metadata, start, observation = values["metadata"], values["start"], values["observation"]
    rules = {name: values[name] for name in rules_of_episodes(race_type)}
    if "direction" not in changes:
        rules |= _direction_of(track)
    race_rules = RaceRules(race_type=race_type, seed=layout_seed or 0, **rules)
    if start not in STARTS:
        raise ValueError(f"start must be 'fixed' or 'random', not {start!r}")
    checked = check_metadata(metadata)
    _check_observation(observation, checked)
    tracks = [(track, theme), *(one if isinstance(one, tuple) else (one, theme) for one in values["more_tracks"])]
    ways = tuple(_ways(one, race_rules.direction, look, values["alternate_direction"]) for one, look in tracks)
    setting = Setting(
        ground=ways[0][0],
        rules=race_rules,
        metadata=checked,
        actions=ActionSpace.from_metadata(checked.to_dict()),
        physics=values["physics"],
        random_start=start == RANDOM,
        layout_seed=layout_seed,
        reward_function=values["reward_function"],
        observation=observation,
        randomise=Randomisation.of(values["randomise"]),
        ways=() if len(ways) == len(ways[0]) == 1 else ways,
    )
    shortest = min(ground.track.length for each in ways for ground in each)
    if not 0.0 <= race_rules.start_m < shortest:
        raise ValueError(f"start_m must be at least 0 and below {shortest:.2f}, not {race_rules.start_m}")
    if setting.rules.boxes or setting.rules.bots or layout_seed is not None:
        for ground in (ground for each in ways for ground in each):
            lay_out(ground.track, setting.rules)  # refuse an impossible layout now
    return setting


def _boxes(changes: Mapping[str, Any]) -> dict[str, object]:
    """The boxes of ``changes``: with fixed places none is drawn unless the number is given."""
    places = tuple(_box_place(place) for place in changes.get("boxes", ()))
    drawn = changes.get("random_boxes")
    if drawn is None:
        drawn = 0 if places else PROPOSED_BOXES
    return {"boxes": places, "random_boxes": drawn}


def _direction_of(track: Track) -> dict[str, str]:
    """The direction in a track's name such as ``reInvent2019_wide_cw``."""
    if not isinstance(track, str):
        return {}  # the trainer has geometries, and the sandbox's lock forbids imports
    from paddock.geometry.catalogue.names import direction_in

    direction = direction_in(track)
    return {"direction": direction} if direction else {}


def _ways(track: Track, direction: str, theme: Theme, both: bool) -> tuple[PreparedTrack, ...]:
    """A track in the direction, with ``both`` in the other one too."""
    shape = load_track(track)
    directions = (direction, other_direction(direction)) if both else (direction,)
    return tuple(PreparedTrack(shape, one, theme) for one in directions)


def _check_observation(observation: str, metadata: ModelMetadata) -> None:
    if observation not in OBSERVATIONS:
        raise ValueError(f"observation must be 'dict', 'box' or 'rgb', not {observation!r}")
    if observation == DICT:
        return
    if len(metadata.sensors) > 1:
        raise ValueError(
            f"observation={observation!r} needs a car with one sensor, this one has {', '.join(metadata.sensors)}: "
            "name one in the metadata, or leave observation='dict'"
        )
    channels = metadata.inputs[0].shape[-1] // metadata.frame_stack
    if observation == RGB and channels != 1:
        raise ValueError(f"observation='rgb' needs a sensor with one channel, {metadata.sensors[0]} has {channels}")


def check_metadata(metadata: Mapping[str, Any]) -> ModelMetadata:
    """``metadata`` read as an upload's. Raises ValueError with the reason of a refusal."""
    try:
        return parse_metadata(json.dumps(dict(metadata)).encode())
    except (TypeError, UserFault) as error:
        raise ValueError(f"metadata: {error}") from error


def load_track(track: Track) -> TrackGeometry:
    """A geometry, a track of the catalogue by any of its names, or one from a track file. Raises ValueError for an
    unknown name, UserFault for an invalid file."""
    if isinstance(track, TrackGeometry):
        return track
    from paddock.geometry.files import FILES, read_track

    if isinstance(track, str) and not track.endswith(FILES):
        from paddock.geometry.catalogue import CATALOGUE
        from paddock.geometry.catalogue.names import find, nearest

        found = find(track)
        if found is not None:
            return found.track.geometry()
        known = ", ".join(entry.slug for entry in CATALOGUE)
        raise ValueError(f"no track {track!r}; the closest names are {', '.join(nearest(track))}; all tracks: {known}")
    path = Path(track)
    return read_track(path.read_bytes(), path.stem, is_open=None)


def _box_place(place: BoxPlace | Mapping[str, Any] | tuple[float, str]) -> BoxPlace:
    if isinstance(place, BoxPlace):
        return place
    return BoxPlace(**place) if isinstance(place, Mapping) else BoxPlace(*place)

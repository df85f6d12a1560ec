"""What an environment is made of: the same for one car and for many."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping, Sequence
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
    PROPOSED_BOTS,
    PROPOSED_BOXES,
    RUN_RULES,
    TIME_TRIAL,
    BoxPlace,
    RaceRules,
    other_direction,
)

from ..action import DISCRETE, ActionSpace
from ..camera.theme import OFFICIAL, Theme
from ..layout import lay_out
from ..physics import PADDOCK_CAR, CarPhysics
from ..randomisation import NOTHING, Randomisation
from ..rewards import RewardFunction, avoid_objects, follow_centre_line
from ..sensors import sensor_spec
from ..stage import PreparedTrack

# Five angles at two speeds: what the console offered by default, at speeds that finish a lap in reasonable time.
DEFAULT_METADATA: Mapping[str, Any] = {
    "action_space_type": "discrete",
    "action_space": [
        {"steering_angle": angle, "speed": speed} for angle in (-30, -15, 0, 15, 30) for speed in (1.0, 1.5)
    ],
    "sensor": ["FRONT_FACING_CAMERA"],
}

OPEN_ROOM_M = 1.0  # so far before the end of an open track an episode starts at the latest

Track = TrackGeometry | str | os.PathLike[str]
Readings = dict[str, np.ndarray]

DICT, BOX, RGB = OBSERVATIONS = ("dict", "box", "rgb")


@dataclass(frozen=True)
class Setting:
    """Track, rules, car and reward of an environment. Made by :func:`time_trial`, :func:`object_avoidance` and
    :func:`head_to_head`, whose arguments are those of the environments."""

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
    # of each track the way asked for, and behind it the other one where episodes alternate; empty: ``ground`` alone
    ways: tuple[tuple[PreparedTrack, ...], ...] = ()

    def ground_of(self, episode: int, rng: np.random.Generator) -> PreparedTrack:
        """Where a car's episode drives, counted from 0: one of the tracks, drawn, and of it the ways by turns."""
        if not self.ways:
            return self.ground
        ways = self.ways[int(rng.integers(len(self.ways)))] if len(self.ways) > 1 else self.ways[0]
        return ways[episode % len(ways)]

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors, sorted."""
        return tuple(sorted(self.metadata.sensors))

    @property
    def boxes(self) -> dict[str, spaces.Box]:
        """One for each sensor: cameras uint8 (120, 160, channels), lidars a row of float32."""
        specs = (sensor_spec(name, self.metadata.lidar_config) for name in self.sensors)
        return {spec.name: spaces.Box(spec.low, spec.high, spec.shape, np.dtype(spec.dtype).type) for spec in specs}

    @property
    def sensor_space(self) -> spaces.Dict:
        """:attr:`boxes` as one space."""
        return spaces.Dict(dict(self.boxes))

    @property
    def observation_space(self) -> spaces.Dict | spaces.Box:
        """What an agent is given: :attr:`sensor_space`, or the only sensor's own box (see :func:`race_setting`)."""
        if self.observation == DICT:
            return self.sensor_space
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
        """Where an episode on ``ground`` starts, in metres after the finish line. ``options["start_m"]``: metres, or a
        function of track and ``rng`` that returns them, None for where it would start without."""
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
        """The rules of one episode: with another seed for boxes and bots in each, unless ``layout_seed`` fixes it."""
        if not self.draws_layout:
            return self.rules
        return dataclasses.replace(self.rules, seed=int(rng.integers(0, 2**31)))

    @property
    def draws_layout(self) -> bool:
        """Whether every episode draws its own boxes or bots."""
        return self.rules.race_type != TIME_TRIAL and self.layout_seed is None


def time_trial(**options: Any) -> Setting:
    """Laps alone; ``options``: see :func:`race_setting`."""
    return race_setting(TIME_TRIAL, **options)


def object_avoidance(
    *,
    boxes: Sequence[BoxPlace | Mapping[str, Any] | tuple[float, str]] = (),
    random_boxes: int | None = None,
    reward_function: RewardFunction = avoid_objects,
    **options: Any,
) -> Setting:
    """Laps past boxes: at fixed places (fraction of the lap, lane), or ``random_boxes`` of them (6 unless told
    otherwise) in other places in every episode, drawn from the seed of ``reset``; always the same with ``layout_seed``.

    ``options``: as for :func:`race_setting`.
    """
    places = tuple(_box_place(place) for place in boxes)
    count = (0 if places else PROPOSED_BOXES) if random_boxes is None else random_boxes
    return race_setting(OBJECT_AVOIDANCE, boxes=places, random_boxes=count, reward_function=reward_function, **options)


def head_to_head(
    *, bots: int = PROPOSED_BOTS, reward_function: RewardFunction = avoid_objects, **options: Any
) -> Setting:
    """Laps among bot cars, which draw their lanes and lane changes from the seed of ``reset``, anew in every episode;
    always the same with ``layout_seed``. ``options``: as for :func:`race_setting`."""
    if not bots:
        raise ValueError("bots must be at least 1: other models do not drive in an environment")
    return race_setting(HEAD_TO_HEAD, bots=bots, reward_function=reward_function, **options)


def rules_of_episodes(race_type: str) -> dict[str, Any]:
    """The rules that an environment of this type takes by their names, and what each is unless somebody says so."""
    told = (rule for name, rule in RUN_RULES.items() if name not in ("race_type", "seed"))
    return {rule.name: rule.default_of_an_episode for rule in told if rule.belongs_to(race_type)}


def race_setting(
    race_type: str,
    *,
    track: Track = "oval",
    metadata: Mapping[str, Any] = DEFAULT_METADATA,
    start: str = "fixed",
    layout_seed: int | None = None,
    reward_function: RewardFunction = follow_centre_line,
    observation: str = DICT,
    theme: Theme = OFFICIAL,
    physics: CarPhysics = PADDOCK_CAR,
    more_tracks: Sequence[Track | tuple[Track, Theme]] = (),
    alternate_direction: bool = False,
    randomise: Randomisation | Mapping[str, float] | None = None,
    **rules: Any,
) -> Setting:
    """``track``: a geometry, a name of the catalogue (``penbay_open`` as well) or the path of a .npy file.
    ``metadata``: a ``model_metadata.json``. ``start``: "fixed" on the finish line or "random", anywhere on the centre
    line.
    ``observation``: "dict" has an entry for each sensor; "box" is the reading of the only sensor itself; "rgb" the same
    as three equal channels, for wrappers that want a colour picture. ``more_tracks``: each episode drives on ``track``
    or one of these, drawn from the seed of ``reset``; a pair names the look of one as well.
    ``alternate_direction``: a car's every second episode drives the other way. ``randomise``: strengths from 0 to 1 of
    what each episode draws about the world, see :class:`.randomisation.Randomisation`. ``rules``: see
    :func:`rules_of_episodes`.

    Raises TypeError for a rule that this type of race does not have, ValueError for a wrong argument or for metadata
    that an upload would be refused for, UserFault for a track file or a layout that is refused.
    """
    usual = rules_of_episodes(race_type)
    if unknown := rules.keys() - usual.keys():
        raise TypeError(f"{race_type} takes no {', '.join(sorted(unknown))}; its rules are {', '.join(usual)}")
    told = RaceRules(race_type=race_type, seed=layout_seed or 0, **{**usual, **_direction_of(track), **rules})
    if start not in ("fixed", "random"):
        raise ValueError(f"start must be 'fixed' or 'random', not {start!r}")
    checked = check_metadata(metadata)
    _check_observation(observation, checked)
    tracks = [(track, theme), *(one if isinstance(one, tuple) else (one, theme) for one in more_tracks)]
    ways = tuple(_ways(one, told.direction, look, alternate_direction) for one, look in tracks)
    setting = Setting(
        ground=ways[0][0],
        rules=told,
        metadata=checked,
        actions=ActionSpace.from_metadata(checked.to_dict()),
        physics=physics,
        random_start=start == "random",
        layout_seed=layout_seed,
        reward_function=reward_function,
        observation=observation,
        randomise=Randomisation.of(randomise),
        ways=() if len(ways) == len(ways[0]) == 1 else ways,
    )
    shortest = min(ground.track.length for each in ways for ground in each)
    if not 0.0 <= told.start_m < shortest:
        raise ValueError(f"start_m must be at least 0 and below {shortest:.2f}, not {told.start_m}")
    if setting.rules.boxes or setting.rules.bots or layout_seed is not None:
        for ground in (ground for each in ways for ground in each):
            lay_out(ground.track, setting.rules)  # refuse now what every episode would be refused for
    return setting


def _direction_of(track: Track) -> dict[str, str]:
    """The direction that a track's name asks for, as ``reInvent2019_wide_cw`` does."""
    if not isinstance(track, str):
        return {}  # the trainer has geometries only: behind the sandbox's lock nothing can be imported
    from paddock.geometry.catalogue.names import direction_in

    direction = direction_in(track)
    return {"direction": direction} if direction else {}


def _ways(track: Track, direction: str, theme: Theme, both: bool) -> tuple[PreparedTrack, ...]:
    """A track in the direction, and in the other one too where ``both``."""
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
    """``metadata`` as an upload's would be read. Raises ValueError with the reason for which it would be refused."""
    try:
        return parse_metadata(json.dumps(dict(metadata)).encode())
    except (TypeError, UserFault) as error:
        raise ValueError(f"metadata: {error}") from error


def load_track(track: Track) -> TrackGeometry:
    """A geometry as it is, one of the catalogue by any of its names, or one from a .npy file. Raises ValueError for a
    name that is neither in the catalogue nor a file, UserFault for a file that is refused."""
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

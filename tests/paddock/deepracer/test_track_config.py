"""``track_config`` of strings: each key changes what it names, and what is not possible is refused by its key."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import paddock.deepracer
from paddock.deepracer.track_config import DEFAULT, WITHOUT_EFFECT
from paddock.rules.race import HEAD_TO_HEAD, OBJECT_AVOIDANCE, TIME_TRIAL

assert paddock.deepracer


def setting(**track_config):
    return gymnasium.make("deepracer-v0", track_config=track_config).unwrapped.setting


def test_the_default_is_the_originals():
    usual = setting()
    assert usual.ground.track.length == pytest.approx(16.64, abs=0.01), "reInvent2019_wide"
    assert usual.random_start and len(usual.ways[0]) == 2 and usual.rules.race_type == TIME_TRIAL
    assert setting(**{key: value for key, value in DEFAULT.items() if value is not None}).rules == usual.rules


def test_the_track_is_that_of_the_config_or_of_the_argument():
    env = gymnasium.make("deepracer-v0", world_name="Oval_track", track_config={"WORLD_NAME": "Bowtie_track"})
    assert env.unwrapped.track.length == pytest.approx(19.55, abs=0.01)
    assert setting(WORLD_NAME="reinvent_base").ground.track.length == pytest.approx(17.71, abs=0.01)
    assert setting(WORLD_NAME="penbay_open_cw").ground.track.direction == "cw"


def test_an_evaluation_with_a_world_keeps_the_numbers_of_objects_alone():
    given = {"NUMBER_OF_OBSTACLES": "2", "CHANGE_START_POSITION": "false", "MIN_DISTANCE_BETWEEN_OBSTACLES": "4.0"}
    made = [
        gymnasium.make("deepracer-v0", track_config=given, world_name=world, evaluation=True).unwrapped
        for world in ("Oval_track", None)
    ]
    assert [env.setting.random_start for env in made] == [True, False]
    assert [env.setting.rules.box_distance_m for env in made] == [2.0, 4.0]
    assert [env.setting.rules.random_boxes for env in made] == [2, 2]
    assert [env.track_config["WORLD_NAME"] for env in made] == ["Oval_track", "reInvent2019_wide"]


@pytest.mark.parametrize("no", ["false", "False", " FALSE ", False])
def test_start_and_direction_can_be_fixed(no):
    fixed = setting(CHANGE_START_POSITION=no, ALTERNATE_DRIVING_DIRECTION=no)
    assert not fixed.random_start and not fixed.ways and fixed.ground.track.direction == "ccw"
    assert setting(REVERSE_DIR="true", ALTERNATE_DRIVING_DIRECTION=no).ground.track.direction == "cw"


def test_obstacles_are_drawn_or_evenly_spaced_or_where_they_are_put():
    drawn = setting(NUMBER_OF_OBSTACLES="4", MIN_DISTANCE_BETWEEN_OBSTACLES="2.5").rules
    assert (drawn.race_type, drawn.random_boxes, drawn.box_distance_m, drawn.boxes) == (OBJECT_AVOIDANCE, 4, 2.5, ())
    even = setting(NUMBER_OF_OBSTACLES="4", RANDOMIZE_OBSTACLE_LOCATIONS="false")
    metres = [place.fraction * even.ground.track.length for place in even.rules.boxes]
    assert metres[0] == pytest.approx(2.0) and metres[-1] == pytest.approx(even.ground.track.length - 1.0, abs=1e-3)
    assert np.ptp(np.diff(metres)) < 1e-9 and [place.lane for place in even.rules.boxes] == ["inner", "outer"] * 2
    assert len(setting(NUMBER_OF_OBSTACLES="1", RANDOMIZE_OBSTACLE_LOCATIONS="false").rules.boxes) == 1


@pytest.mark.parametrize(
    "places",
    [["0.25,1", "0.5, -1"], "0.25,1;0.5,-1", [(0.25, 1), (0.5, -1)], [["0.25", "1"], ["0.5", "-1"]]],
)
def test_one_is_the_inner_lane_and_places_override_the_number(places):
    rules = setting(OBJECT_POSITIONS=places, NUMBER_OF_OBSTACLES="6").rules
    assert [(place.fraction, place.lane) for place in rules.boxes] == [(0.25, "inner"), (0.5, "outer")]
    assert rules.random_boxes == 0


def test_bots_drive_as_they_are_told():
    usual = setting(NUMBER_OF_BOT_CARS="3")
    assert usual.rules.race_type == HEAD_TO_HEAD and usual.draws_layout
    assert (usual.rules.bots, usual.rules.bot_speed_mps, usual.rules.bot_lane_changes) == (3, 0.2, False)
    changed = setting(
        NUMBER_OF_BOT_CARS="2",
        BOT_CAR_SPEED="1.5",
        IS_LANE_CHANGE="true",
        LOWER_LANE_CHANGE_TIME="1.5",
        UPPER_LANE_CHANGE_TIME="2.5",
        LANE_CHANGE_DISTANCE="2.0",
        RANDOMIZE_BOT_CAR_LOCATIONS="false",
        MIN_DISTANCE_BETWEEN_BOT_CARS="5.0",
    )
    rules = changed.rules
    assert (rules.bot_speed_mps, rules.bot_lane_changes, rules.bot_lane_change_m) == (1.5, True, 2.0)
    assert (rules.bot_lane_change_least_ms, rules.bot_lane_change_most_ms) == (1500, 2500)
    assert not changed.draws_layout


def test_light_and_colours_are_drawn_where_it_is_asked_for():
    assert not setting().randomise
    assert (setting(ENABLE_DOMAIN_RANDOMIZATION="true").randomise.light) == 1.0


def test_what_only_names_or_paints_things_is_ignored():
    assert setting(**dict.fromkeys(WITHOUT_EFFECT, "x")).rules == setting().rules


BOXES = {"NUMBER_OF_OBSTACLES": "2"}
REFUSED = [
    ({"WORLD_NAME": "Nowhere"}, "WORLD_NAME.*Nowhere"),
    ({"WORLD_NAME": "reInvent2019_wide_mirrored"}, "WORLD_NAME.*closest names are"),
    ({"NUMBER_OF_OBSTACLES": "11"}, "NUMBER_OF_OBSTACLES.*0 to 10"),
    ({"NUMBER_OF_OBSTACLES": "two"}, "NUMBER_OF_OBSTACLES"),
    ({"NUMBER_OF_BOT_CARS": "7"}, "NUMBER_OF_BOT_CARS.*0 to 6"),
    ({"NUMBER_OF_BOT_CARS": "-1"}, "NUMBER_OF_BOT_CARS"),
    (BOXES | {"NUMBER_OF_BOT_CARS": "1"}, "NUMBER_OF_OBSTACLES.*NUMBER_OF_BOT_CARS"),
    (BOXES | {"IS_OBSTACLE_BOT_CAR": "true"}, "IS_OBSTACLE_BOT_CAR.*NUMBER_OF_BOT_CARS"),
    (BOXES | {"RESET_BEHIND_DIST": "2.0"}, "RESET_BEHIND_DIST"),
    (BOXES | {"MIN_DISTANCE_BETWEEN_OBSTACLES": "x"}, "MIN_DISTANCE_BETWEEN_OBSTACLES"),
    (BOXES | {"MIN_DISTANCE_BETWEEN_OBSTACLES": "25"}, "MIN_DISTANCE_BETWEEN_OBSTACLES must be from 0.5 to 20"),
    ({"NUMBER_OF_OBSTACLES": "10", "RANDOMIZE_OBSTACLE_LOCATIONS": "false"}, "NUMBER_OF_OBSTACLES.*no room"),
    ({"OBJECT_POSITIONS": ["0.5,0"]}, "OBJECT_POSITIONS.*1 inside or -1 outside"),
    ({"OBJECT_POSITIONS": ["0.5"]}, "OBJECT_POSITIONS"),
    ({"OBJECT_POSITIONS": [0.5]}, "OBJECT_POSITIONS"),
    ({"OBJECT_POSITIONS": ["0.5,1", "0.51,1"]}, "OBJECT_POSITIONS"),
    ({"NUMBER_OF_BOT_CARS": "4", "MIN_DISTANCE_BETWEEN_BOT_CARS": "5"}, "MIN_DISTANCE_BETWEEN_BOT_CARS.*at most 2.8"),
    ({"NUMBER_OF_BOT_CARS": "1", "BOT_CAR_SPEED": "9"}, "BOT_CAR_SPEED must be from 0.2 to 4"),
    ({"NUMBER_OF_BOT_CARS": "1", "LOWER_LANE_CHANGE_TIME": "0.1"}, "LOWER_LANE_CHANGE_TIME must be from 0.5 to 60"),
    ({"NUMBER_OF_BOT_CARS": "1", "LOWER_LANE_CHANGE_TIME": "6"}, "LOWER_LANE_CHANGE_TIME"),
    ({"NUMBER_OF_BOT_CARS": "1", "WORLD_NAME": "Straight_track"}, "NUMBER_OF_BOT_CARS|WORLD_NAME"),
    ({"CHANGE_START_POSITION": "yes"}, "CHANGE_START_POSITION"),
    ({"NUMBER_OF_RESETS": "3"}, "NUMBER_OF_RESETS"),
    ({"RACE_TYPE": "HEAD_TO_MODEL"}, "RACE_TYPE"),
    ({"NUMBER_OF_OBSTACLE": "1"}, "NUMBER_OF_OBSTACLE.*did you mean NUMBER_OF_OBSTACLES"),
    ({"zzz": "1"}, "zzz"),
]


@pytest.mark.parametrize(("track", "said"), REFUSED, ids=[" ".join(track) for track, _ in REFUSED])
def test_what_is_not_possible_is_refused_by_its_key(track, said):
    with pytest.raises(ValueError, match=said):
        setting(**track)

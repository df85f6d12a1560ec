"""Numbers and names in the pages are those of the code."""

from __future__ import annotations

import importlib.util
import re

import gymnasium
import numpy as np
import pytest

from accounts.tokens.services import TOKENS_PER_RACER
from evaluation.sandbox.policy_client import OVERAGE_S, STEP_DEADLINE_S, TOTAL_S
from paddock.geometry.checks import MAX_LENGTH_M, MAX_WAYPOINTS, MAX_WIDTH_M, MIN_LENGTH_M, MIN_WAYPOINTS, MIN_WIDTH_M
from paddock.network.model import IR_HIGH, IR_LOW, OPSET_HIGH, OPSET_LOW
from paddock.packages.gate.operators import OPERATORS
from paddock.packages.inputs import CAMERAS, SENSOR_NAMES
from paddock.packages.limits import DEFAULT_LIMITS, MEGABYTE
from paddock.packages.metadata import ALGORITHMS, MAX_ACTIONS, NETWORKS
from paddock.packages.own import read_car
from paddock.rules.race import RACE_TYPES
from paddock.simulator import lidar
from paddock.simulator.camera.optics import FRONT_CAMERA, STEREO_LEFT
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.car import Pose
from paddock.simulator.engine import ENGINE_ID
from paddock.simulator.envs import DEFAULT_METADATA, load_track
from paddock.simulator.envs.configuration import OPTIONS, rules_of_episodes
from paddock.simulator.envs.setting import time_trial
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.rewards import Objects
from paddock.simulator.trace import COLUMNS, STATUSES
from races.rules.validation import MAX_AHEAD, MAX_DURATION

from .pages import code_blocks, section, text


def test_the_listed_operators_are_the_allowed_ones():
    contract = section(text("formats.md"), "## The ONNX contract")
    listed = contract.split("Allowed operators:")[1].split("Not allowed:")[0]
    assert set(re.findall(r"`(\w+)`", listed)) == set(OPERATORS)
    refused = contract.split("Not allowed:")[1]
    assert not set(re.findall(r"`([A-Z]\w+)`", refused)) & set(OPERATORS)


def test_the_bounds_of_an_upload_are_correct():
    page = text("formats.md")
    limits = DEFAULT_LIMITS
    assert f"{limits.upload_bytes // MEGABYTE} MB for the upload as sent" in page
    assert f"{limits.model_bytes // MEGABYTE} MB for the network, {limits.expanded_bytes // MEGABYTE} MB" in page
    assert f"{limits.archive_members} members" in page
    assert f"at most {limits.metadata_bytes // 1000} kB" in page
    assert f"at most {limits.nodes} operators, {limits.tensor_elements // 10**6} million numbers" in page
    assert f"{limits.macs // 10**6} million multiplications and {limits.elements // 10**6} million" in page
    assert f"`opset` {OPSET_LOW} to {OPSET_HIGH}, IR version {IR_LOW} to {IR_HIGH}" in page
    assert f"a list of 1 to {MAX_ACTIONS} objects" in page


def test_every_network_and_algorithm_is_named():
    page = section(text("formats.md"), "## model_metadata.json")
    for word in (*NETWORKS, *ALGORITHMS):
        assert f"`{word}`" in page


def test_the_environment_snippet_names_its_arguments():
    page = section(text("environments.md"), "## The three race types")
    rows = "\n".join(re.findall(r"^\| (`[^|]+) \|", page, re.M))
    assert set(re.findall(r"`(\w+)`", rows)) == {*OPTIONS, "render_mode", "config"}


def test_every_environment_rule_has_its_default_in_the_table():
    rows = dict(re.findall(r"^\| `(\w+)` \| .* \| (.+?) \|$", text("reference.md"), re.M))
    assert {name for race_type in RACE_TYPES for name in rules_of_episodes(race_type)} <= set(rows)


def test_every_sensor_and_the_lidar_beams_are_described():
    page = section(text("simulator.md"), "## Sensors")
    rows = "\n".join(re.findall(r"^\| (`[^|]+) \|", page, re.M))
    assert set(re.findall(r"`(\w+)`", rows)) == set(SENSOR_NAMES)
    beams = {
        "0": "30 degrees left of straight ahead",
        "63": "30 degrees right of straight ahead",
        "12 and 13": "left (87 and 92 degrees)",
    }
    for beam, looks in beams.items():
        assert f"| {beam} | {looks} |" in page
    assert [round(lidar.BEAM_DEG[beam]) for beam in (0, 12, 13, 63)] == [30, 87, 92, -30]
    assert f"sits {lidar.MOUNT_X} m ahead" in page
    assert f"from {lidar.LEAST_M} to {lidar.MOST_M:g} m and are rounded to {lidar.STEP_M} m" in page
    assert f"clipped to {lidar.LEAST_M} to {lidar.RAW_LIMIT_M}" in page
    assert f"8 beams is under {lidar.SECTOR_LIMIT_M} m" in page


def test_the_object_keys_of_reward_params_have_rows():
    page = section(text("environments.md"), "## Rewards")
    rows = "\n".join(re.findall(r"^\| (`[^|]+) \|", page, re.M))
    keys = set(Objects(load_track("oval")).params(Pose(0.0, 0.0, 0.0), 0.0, []))
    assert set(re.findall(r"`(\w+)`", rows)) == keys | {"is_crashed"}


def test_every_key_of_an_environments_info_has_a_row():
    page = section(text("environments.md"), "## Info")
    rows = "\n".join(re.findall(r"^\| (`[^|]+) \|", page, re.M))
    env = gymnasium.make("Paddock/TimeTrial-v1", max_simulated_ms=100)
    _, first = env.reset(seed=1)
    last: dict = {}
    while "end_reason" not in last:
        last = env.step(0)[-1]
    env.close()
    assert set(re.findall(r"`(\w+)`", rows)) == set(first) | set(last)


@pytest.mark.parametrize("name", SENSOR_NAMES)
def test_the_observation_space_of_every_sensor_is_correct(name):
    page = section(text("environments.md"), "## Observations")
    (said,) = re.findall(rf"^\| .*`{name}`.* \| `Box\(([^,]+), ([^,]+), \((.+?),?\), (\w+)\)`", page, re.M)
    setting = time_trial(metadata={**DEFAULT_METADATA, "sensor": [name] if name in CAMERAS else [name, "observation"]})
    space = setting.observation_space[name]
    low, high, shape, dtype = said
    assert (np.float32(low), np.float32(high), dtype) == (space.low.min(), space.high.max(), space.dtype)
    config = setting.metadata.lidar_config
    size = shape.replace("sectors × values", str(config["num_sectors"] * config["num_values_per_sector"]))
    assert tuple(int(part) for part in size.split(", ")) == space.shape


@pytest.mark.slow
def test_the_environment_snippet_runs(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    snippets = [block for block in code_blocks(text("environments.md"), "python")]
    names: dict = {}
    for snippet in snippets:
        needed = [module for module in ("stable_baselines3", "torchrl") if f"from {module}" in snippet]
        if all(importlib.util.find_spec(module) for module in needed):
            # one update of little instead of a training
            exec(snippet.replace("n_steps=128", "n_steps=2, batch_size=32, n_epochs=1").replace("100_000", "1"), names)
    names["env"].close()
    assert names["observation"]["FRONT_FACING_CAMERA"].shape == (120, 160, 1)
    if (tmp_path / "car.zip").exists():
        assert read_car([tmp_path / "car.zip"]).metadata["sensor"] == ["STEREO_CAMERAS", "LIDAR"]
    names["cars"].close()
    assert names["observations"]["FRONT_FACING_CAMERA"].shape == (16, 120, 160, 1)


def test_the_numbers_on_the_simulator_page_are_correct():
    page = text("simulator.md")
    theme, car, camera = OFFICIAL, PADDOCK_CAR, FRONT_CAMERA
    for line in (
        f"| road, between the borders of the track file | {theme.road} |",
        f"| border lines, {theme.line_width} m wide, inside the road | {theme.line} |",
        f"dashes {theme.dash_length} × {theme.dash_width} m, one every {theme.dash_pitch} m | {theme.dash} |",
        f"{theme.field_margin} m around it | {theme.field} |",
        f"{theme.wall_height} m high | {theme.wall} |",
        f"| sky | {theme.sky} |",
        "| a box: front, left, back and right | {}, {}, {} and {} |".format(*theme.box),
        "| {}, {}, {} and {}; {}; {} |".format(*theme.car, theme.car_window, theme.car_wheel),
        f"sit {STEREO_LEFT.y} m to the left",
        f"reckoned in ticks of a fixed {car.tick_hz} Hz ({car.ticks_per_step} ticks a step)",
        f"at a fixed {car.tick_hz / car.ticks_per_move:g} Hz ({car.moves(car.ticks_per_step)} times a step)",
        f"Bullet at {car.tick_hz / car.ticks_per_move:g} Hz",
        f"tan(a) / {car.effective_wheelbase} m for a steering command a",
        f"n = {car.curvature_limit_sharpness}, for a demanded k",
        f"l = {car.curvature_limit} / (1 + {car.curvature_limit_falloff} v²) 1/m",
        f"{car.steering_lag_s_per_mps} s for each m/s of speed, and {car.steering_dead_ticks} ticks",
        f"within {car.speed_rise_s} s up, at most {car.acceleration} m/s², and {car.speed_fall_s} s down, "
        f"at most {car.braking:g} m/s²; {car.speed_dead_ticks} ticks of dead time",
        f"| speed gain | {car.speed_gain}",
        f"`{car.name}`, version {car.version}",
        f"friction {car.friction}",
        f"{camera.x} m ahead of the base, {camera.height} m above the ground",
        f"{camera.pitch} rad down",
        f"{camera.horizontal_fov} rad",
        f"Its budget is {STEP_DEADLINE_S:g} s of wall time for a step, {OVERAGE_S:g} s in all",
        f"{TOTAL_S:g} s for the whole run",
        f"`{ENGINE_ID}`",
        f"{MIN_WAYPOINTS} to {MAX_WAYPOINTS}",
        f"{MIN_LENGTH_M:g} to {MAX_LENGTH_M:g} m long, {MIN_WIDTH_M:g} to {MAX_WIDTH_M:g} m wide",
    ):
        assert line in page.replace("\n", " ") or line in page, line


def test_every_column_and_status_of_the_trace_is_explained():
    part = section(text("simulator.md"), "### Sim-trace CSV")
    explained = set(re.findall(r"`(\w+)`", "\n".join(re.findall(r"^\| ([^|]+) \|", part, re.M))))
    assert explained == set(COLUMNS)
    assert set(STATUSES) <= set(re.findall(r"`(\w+)`", part))


def test_limits_of_races_and_tokens_are_correct():
    assert f"at most {MAX_DURATION.days} days long; opening at most {MAX_AHEAD.days} days ahead" in text(
        "organisers.md"
    )
    assert f"a racer keeps at most {TOKENS_PER_RACER}" in text("api.md")

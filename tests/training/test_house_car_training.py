"""Training: what the learner sees and earns, what it writes, and that it learns nothing false on the way to ONNX."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from training.house_cars.__main__ import main
from training.house_cars.environment import SENSOR, Daylight, Forward, OnnxDriver, Score, make_env, pool, top_speed
from training.house_cars.files import KEY, write_table
from training.house_cars.recipes import BRISK, FLYER, STEADY, Recipe


def frames(count: int = 20) -> list[np.ndarray]:
    """What a car sees on its way over a track."""
    env = gymnasium.make("Paddock/TimeTrial-v1", track="oval", metadata=STEADY.metadata, start="random")
    seen = []
    for seed in range(count):
        readings, _ = env.reset(seed=seed)
        seen.append(readings[SENSOR])
    env.close()
    return seen


def params(**changes: object) -> dict:
    """Reward parameters of a car in the middle of a 40 m track."""
    return {
        "projection_distance": 10.0,
        "track_length": 40.0,
        "track_width": 1.0,
        "distance_from_center": 0.0,
        "is_offtrack": False,
    } | changes


def test_a_pooled_pixel_is_the_mean_of_sixteen() -> None:
    frame = np.zeros((120, 160, 1), np.uint8)
    frame[4:8, 8:12, 0] = 255
    frame[0, 0, 0] = 160

    small = pool(frame)

    assert small.shape == (1, 30, 40)
    assert small.dtype == np.float32
    assert small[0, 1, 2] == pytest.approx(1.0)
    assert small[0, 0, 0] == pytest.approx(10 / 255)
    assert small.sum() == pytest.approx(1.0 + 10 / 255)


def test_full_speed_on_the_centre_line_earns_one() -> None:
    reward = Forward(STEADY, top_speed(STEADY))
    step = top_speed(STEADY) / 15

    assert reward(params()) == 0.0
    assert reward(params(projection_distance=10.0 + step)) == pytest.approx(1.0)


def test_crossing_the_finish_line_costs_nothing() -> None:
    reward = Forward(STEADY, 1.5)
    reward(params(projection_distance=39.95))

    assert reward(params(projection_distance=0.05)) == pytest.approx(1.0)


def test_reversing_costs_and_the_edge_earns_less() -> None:
    reward = Forward(BRISK, 1.5)
    reward(params())

    assert reward(params(projection_distance=9.9)) == pytest.approx(-1.0)
    assert reward(params(distance_from_center=0.5)) == pytest.approx(1.0 - BRISK.focus)


def test_leaving_the_track_earns_nothing() -> None:
    reward = Forward(STEADY, 1.5)
    reward(params())

    assert reward(params(projection_distance=10.1, is_offtrack=True)) == 0.0


def test_light_varies_by_episode_and_repeats_with_the_seed() -> None:
    env = make_env(STEADY, "oval", "ccw")()
    try:
        assert isinstance(env, Daylight)
        first, _ = env.reset(seed=1, options={"start_m": 3.0})
        again, _ = env.reset(seed=1, options={"start_m": 3.0})
        other, _ = env.reset(options={"start_m": 3.0})
    finally:
        env.close()

    assert np.array_equal(first, again)
    assert abs(float(other.mean() - first.mean())) > 0.001
    assert env.observation_space.contains(first)


def test_a_clean_lap_past_boxes_is_worth_more_than_speed() -> None:
    assert Score(clean=2, speed=0.5, distance=0.4).key > Score(clean=1, speed=3.0, distance=0.9).key
    assert Score(clean=2, speed=0.6, distance=0.4).key > Score(clean=2, speed=0.5, distance=0.9).key
    assert Score(clean=0, speed=0.0, distance=0.6).key > Score(clean=0, speed=0.0, distance=0.4).key
    assert Score(clean=1, speed=0.0, distance=0.1).key > Score(clean=0, speed=0.0, distance=0.99).key


def test_an_unknown_car_is_refused_with_the_known_names(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["nobody"])

    assert ended.value.code == 2
    assert "no house car is named 'nobody'; there are steady, brisk, flyer" in capsys.readouterr().err


def test_the_readmes_table_has_lap_times_and_resets(tmp_path: Path) -> None:
    from paddock.geometry.catalogue import CATALOGUE

    found = {"complete_laps": 3, "average_lap_ms": 12345, "best_lap_ms": 12000, "off_tracks": 1, "resets": 1}
    none = {"complete_laps": 0, "average_lap_ms": None, "best_lap_ms": None, "off_tracks": 9, "resets": 9}
    measured = {entry.slug: {"ccw": found, "cw": none} for entry in CATALOGUE}
    (tmp_path / "x.json").write_text(json.dumps({KEY: {"display_name": "X", "measured": measured}}))
    readme = tmp_path / "README.md"
    readme.write_text("before\n<!-- lap times: begin -->\nold\n<!-- lap times: end -->\nafter\n")

    write_table(tmp_path)

    text = readme.read_text()
    assert text.startswith("before\n<!-- lap times: begin -->\n| track | direction | X |\n")
    assert text.endswith("<!-- lap times: end -->\nafter\n")
    assert "| Paddock Oval | ccw | 12.345 (1 reset) |\n| Paddock Oval | cw | no lap |" in text
    assert "old" not in text


@pytest.mark.parametrize("recipe", [STEADY, FLYER], ids=lambda recipe: recipe.name)
def test_the_exported_network_answers_as_the_trained_one(recipe: Recipe) -> None:
    torch = pytest.importorskip("torch", reason="torch is not installed: pip install 'paddock[training]'")
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed")
    from stable_baselines3.common.policies import ActorCriticPolicy

    from training.house_cars.learner import exported, policy_options

    torch.manual_seed(5)
    env = make_env(recipe, "oval", "ccw")()
    policy = ActorCriticPolicy(
        env.observation_space,
        env.action_space,
        lambda _: 0.0,
        **policy_options(recipe),
    )
    env.close()
    driver = OnnxDriver(exported(recipe, policy))

    for frame in frames():
        with torch.no_grad():
            features = policy.extract_features(torch.from_numpy(pool(frame))[None])
            expected = policy.action_net(features).numpy()
        assert driver({SENSOR: frame}) == pytest.approx(expected, abs=2e-5)


@pytest.mark.slow
def test_a_short_training_writes_a_car_with_its_record(tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="torch is not installed: pip install 'paddock[training]'")
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed")
    from training.house_cars.__main__ import make

    make(STEADY, tmp_path, seed=3, seconds=1.0)

    assert sorted(path.name for path in tmp_path.iterdir()) == ["steady.json", "steady.onnx"]
    made = json.loads((tmp_path / "steady.json").read_text())[KEY]["made"]
    assert made["seed"] == 3
    assert made["steps"] > 0
    assert made["parameters"] == 202_437

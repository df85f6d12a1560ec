"""What episodes draw about the world: bounded, from their seed, and nothing where nobody asked for it."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import paddock.simulator.envs  # noqa: F401  registers the environments
from paddock.simulator.action import Action
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.randomisation import CAMERA_GREYS, LATENCY_STEPS, Randomisation
from paddock.simulator.vector import TimeTrialVectorEnv

from .tracks_for_tests import stadium

TRACK = stadium(2.0)
LIDAR = {
    "action_space_type": "discrete",
    "action_space": [{"steering_angle": angle, "speed": 1.0} for angle in (-20, 20)],
    "sensor": ["LIDAR", "FRONT_FACING_CAMERA"],
}


def drawn(seed: int = 1, **strengths: float):
    return Randomisation(**strengths).draw(np.random.default_rng(seed), OFFICIAL)


def frames(seed: int = 7, steps: int = 2, **options) -> list[np.ndarray]:
    env = gymnasium.make("Paddock/TimeTrial-v1", track=TRACK, observation="box", **options)
    try:
        seen = [env.reset(seed=seed)[0]]
        return seen + [env.step(4)[0] for _ in range(steps)]
    finally:
        env.close()


@pytest.fixture(scope="module")
def usual() -> list[np.ndarray]:
    return frames()


def test_strengths_of_nothing_change_no_bit(usual):
    assert all(np.array_equal(one, other) for one, other in zip(usual, frames(randomise={"light": 0.0}), strict=True))


@pytest.mark.parametrize("name", ["light", "colours", "start", "sensors"])
def test_each_strength_changes_what_the_car_sees_by_the_seed(usual, name):
    seen = frames(randomise={name: 1.0})
    assert not np.array_equal(usual[0], seen[0])
    assert all(np.array_equal(one, again) for one, again in zip(seen, frames(randomise={name: 1.0}), strict=True))
    assert not np.array_equal(seen[0], frames(seed=8, steps=0, randomise={name: 1.0})[0])


def test_light_keeps_the_order_of_greys_and_its_bounds():
    for seed in range(20):
        table = drawn(seed, light=1.0).greys.astype(int)
        assert (np.diff(table) >= 0).all()
        assert 0.35 * 150 - 1 <= table[150] <= 1.5 * 150 + 1


def test_noise_is_as_strong_as_asked(usual):
    noise = drawn(sensors=0.5).noise
    assert np.std(noise) == pytest.approx(CAMERA_GREYS / 2, rel=0.05)


def test_the_lidar_wavers_and_stays_within_its_range():
    env = gymnasium.make("Paddock/TimeTrial-v1", track=TRACK, metadata=LIDAR, randomise={"sensors": 1.0})
    seen, _ = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    env.close()


def test_latency_carries_actions_out_later_and_in_their_order():
    disturbance = next(one for one in (drawn(seed, latency=1.0) for seed in range(50)) if one.latency == LATENCY_STEPS)
    told = [Action(float(number), 1.0, number) for number in range(6)]
    done = [disturbance.act(action) for action in told]
    assert done[LATENCY_STEPS:] == told[:-LATENCY_STEPS]
    assert all(action.speed_mps == 0.0 for action in done[:LATENCY_STEPS])


def test_a_car_that_starts_aside_is_on_the_road():
    env = gymnasium.make("Paddock/TimeTrial-v1", track=TRACK, start="random", randomise={"start": 1.0})
    for seed in range(10):
        env.reset(seed=seed)
        referee = env.unwrapped._drive.car.referee
        assert abs(referee.odometer.place.offset) < TRACK.width_at(0.0) / 2
        assert not referee.done
    env.close()


@pytest.mark.parametrize(
    ("strengths", "says"),
    [
        ({"light": 1.5}, "from 0 to 1"),
        ({"light": -0.1}, "from 0 to 1"),
        ({"start": float("nan")}, "from 0 to 1"),
        ({"latency": True}, "from 0 to 1"),
        ({"weather": 1.0}, "there are light, colours, start, sensors, latency"),
    ],
)
def test_a_strength_that_makes_no_sense_is_refused(strengths, says):
    with pytest.raises(ValueError, match=says):
        gymnasium.make("Paddock/TimeTrial-v1", track=TRACK, randomise=strengths)


class TestSeveralTracks:
    OTHER = stadium(4.0)

    def lengths(self, episodes: int = 12, seed: int = 3, **options) -> list[tuple[float, str]]:
        env = gymnasium.make("Paddock/TimeTrial-v1", track=TRACK, **options)
        driven = []
        for number in range(episodes):
            env.reset(seed=seed if not number else None)
            ground = env.unwrapped._drive.stage.ground.track
            driven.append((round(ground.length, 2), ground.direction))
        env.close()
        return driven

    def test_episodes_are_drawn_over_all_tracks_from_the_seed(self):
        driven = self.lengths(more_tracks=[self.OTHER])
        assert {length for length, _ in driven} == {round(one.length, 2) for one in (TRACK, self.OTHER)}
        assert driven == self.lengths(more_tracks=[self.OTHER])

    def test_every_second_episode_goes_the_other_way(self):
        assert [direction for _, direction in self.lengths(4, alternate_direction=True)] == ["ccw", "cw", "ccw", "cw"]

    def test_many_cars_drive_as_each_alone(self):
        options = {"track": TRACK, "more_tracks": [self.OTHER], "alternate_direction": True, "start": "random"}
        options["randomise"] = {"light": 0.5, "start": 0.5, "sensors": 0.2, "latency": 1.0}
        cars = TimeTrialVectorEnv(2, autoreset_mode="Disabled", **options)
        alone = [gymnasium.make("Paddock/TimeTrial-v1", **options) for _ in range(2)]
        for _ in range(3):
            together, _ = cars.reset(seed=5)
            each = [env.reset(seed=5 + number)[0] for number, env in enumerate(alone)]
            for _ in range(3):
                for number, seen in enumerate(each):
                    for name, reading in seen.items():
                        assert np.array_equal(together[name][number], reading)
                together = cars.step(np.array([4, 5]))[0]
                each = [env.step(4 + number)[0] for number, env in enumerate(alone)]
        cars.close()
        for env in alone:
            env.close()

    def test_boxes_that_have_no_room_on_one_of_them_are_refused(self):
        from paddock.errors import UserFault

        small = stadium(0.5, radius=0.8, width=0.6)
        options = {"track": self.OTHER, "boxes": [(place, "inner") for place in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)]}
        gymnasium.make("Paddock/ObjectAvoidance-v1", **options)
        with pytest.raises(UserFault):
            gymnasium.make("Paddock/ObjectAvoidance-v1", more_tracks=[small], **options)

"""A course's script for the older package: a port for each environment, sleeps between starts, wrappers, processes."""

import time

import cv2
import gymnasium as gym
import numpy as np
from gymnasium.vector import AsyncVectorEnv

PORTS = (8888, 8889)
time.sleep = lambda seconds: None  # containers need a minute between their starts


class CropAndScale(gym.ObservationWrapper):
    """The lower part of the pair in a quarter of the size, between 0 and 1."""

    def __init__(self, env):
        super().__init__(env)
        self.observation_space = gym.spaces.Box(0.0, 1.0, (2, 40, 80), np.float32)

    def observation(self, observation):
        left, right = observation["STEREO_CAMERAS"]
        small = [cv2.resize(side[40:], (80, 40), interpolation=cv2.INTER_AREA) for side in (left, right)]
        return np.stack(small).astype(np.float32) / 255.0


def make_environment(port):
    time.sleep(60)
    env = gym.make("deepracer_gym:deepracer-v0", port=port, manage_container=False)
    env = CropAndScale(env)
    env = gym.wrappers.FrameStackObservation(env, 4)
    return gym.wrappers.RecordEpisodeStatistics(env)


if __name__ == "__main__":
    envs = AsyncVectorEnv([lambda port=port: make_environment(port) for port in PORTS])
    observations, infos = envs.reset(seed=42)
    assert observations.shape == (2, 4, 2, 40, 80)
    ended = 0
    for _ in range(200):
        observations, rewards, terminations, truncations, infos = envs.step(envs.action_space.sample())
        ended += int((terminations | truncations).sum())
    assert "episode" in infos or ended > 0
    envs.close()
    print("done", ended > 0)

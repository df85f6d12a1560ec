"""A program for the old gym, whose step returns four values."""

import deepracer_gym
import gym
import numpy as np


class Grey(gym.ObservationWrapper):
    def __init__(self, env):
        super().__init__(env)
        self.observation_space = gym.spaces.Box(0, 255, (120, 160, 1), np.uint8)

    def observation(self, observation):
        return observation["STEREO_CAMERAS"][0][:, :, None]


class Halved(gym.RewardWrapper):
    def reward(self, reward):
        return reward / 2


env = Halved(Grey(gym.make("deepracer_gym:deepracer-v0", port=8888)))
env.seed(7)
observation = env.reset()
assert observation.shape == env.observation_space.shape
done, steps, total = False, 0, 0.0
while not done:
    observation, reward, done, info = env.step(env.action_space.sample())
    steps, total = steps + 1, total + reward
assert info["TimeLimit.truncated"] in (True, False) and "reward_params" in info
assert env.render(mode="rgb_array").shape == (120, 320, 3)
env.close()
print("done", steps > 5, total > 0, deepracer_gym.running())

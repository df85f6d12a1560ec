"""stable-baselines3 learns of environments in processes of their own, as courses use it."""

import deepracer_gym
import gymnasium as gym
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv

if __name__ == "__main__":
    env = SubprocVecEnv([lambda port=port: gym.make("deepracer_gym:deepracer-v0", port=port) for port in (8888, 8889)])
    PPO("MultiInputPolicy", env, n_steps=8, batch_size=8, n_epochs=1).learn(16)
    env.close()
    print("done", deepracer_gym.running())

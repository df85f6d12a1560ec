"""stable-baselines3 as courses use it: frames stacked, rewards normalised, three algorithms, three episodes."""

import deepracer_gym
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecFrameStack, VecNormalize

CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"high": 30, "low": -30}, "speed": {"high": 2, "low": 1}},
    "sensor": ["STEREO_CAMERAS"],
}


def learn(algorithm, agent_config=None, **more):
    env = make_vec_env("deepracer-v0", n_envs=2, seed=1, env_kwargs={"agent_config": agent_config})
    env = VecNormalize(VecFrameStack(env, n_stack=4), norm_obs=True, norm_reward=True)
    model = algorithm("MultiInputPolicy", env, seed=1, **more)
    model.learn(total_timesteps=16)
    env.training = False
    mean, _ = evaluate_policy(model, env, n_eval_episodes=1, warn=False)
    env.close()
    return mean > 0


if __name__ == "__main__":
    few = {"buffer_size": 40, "learning_starts": 8, "batch_size": 8}
    found = learn(PPO, n_steps=8, batch_size=8, n_epochs=1), learn(DQN, **few), learn(SAC, CONTINUOUS, **few)
    print("done", *found, deepracer_gym.running())

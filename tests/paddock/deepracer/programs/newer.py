"""A notebook's cells for the newer package: configuration, random drive, evaluation on five episodes, video frames."""

import deepracer
import gymnasium as gym
import numpy as np

agent_config = {
    "action_space_type": "continuous",
    "action_space": {
        "steering_angle": {"high": 30, "low": -30},
        "speed": {"high": 2, "low": 1},
    },
    "sensor": ["FRONT_FACING_CAMERA", "LIDAR"],
}
track_config = {"WORLD_NAME": "reInvent2019_wide", "NUMBER_OF_OBSTACLES": "2", "NUMBER_OF_BOT_CARS": "0"}


def reward_function(params):
    if params["is_offtrack"] or params["is_crashed"]:
        return 1e-3
    return float(params["progress"] / params["steps"])


env = gym.make(
    "deepracer-v0",
    agent_config=agent_config,
    track_config=track_config,
    reward_function=reward_function,
    cpus=3,
    memory="6g",
    cache=True,
)
print(env.observation_space, env.action_space)
print(deepracer.running())

frames, returns = [], []
for episode in range(5):
    observation, info = env.reset(seed=episode)
    assert observation["FRONT_FACING_CAMERA"].shape == (3, 120, 160)
    total, terminated, truncated = 0.0, False, False
    while not (terminated or truncated):
        action = env.action_space.sample()
        observation, reward, terminated, truncated, info = env.step(action)
        total += reward
        frames.append(env.render())
    status = [key for key, value in info["episode_status"].items() if value]
    print(episode, status, round(info["reward_params"]["progress"], 1))
    returns.append(total)
assert all(frame.shape == (120, 160, 3) for frame in frames)
deepracer.close(env, cache=False)

evaluation = gym.make("deepracer-v0", world_name="Oval_track", evaluation=True)
evaluation.reset()
evaluation.close()
deepracer.shutdown_all()
print("done", len(frames), np.mean(returns) > 0, deepracer.running())

"""A student's own DQN in plain PyTorch: replay, target network, epsilon-greedy."""

import random
from collections import deque

import deepracer
import gymnasium as gym
import numpy as np
import torch
from torch import nn

random.seed(1), np.random.seed(1), torch.manual_seed(1)
device = torch.device("cuda" if torch.cuda.is_available() else "cpu")


class QNetwork(nn.Module):
    def __init__(self, actions):
        super().__init__()
        self.camera = nn.Sequential(
            nn.Conv2d(2, 16, 8, stride=4), nn.ReLU(), nn.Conv2d(16, 16, 4, stride=4), nn.ReLU(), nn.Flatten()
        )
        self.lidar = nn.Sequential(nn.Linear(64, 32), nn.ReLU())
        self.head = nn.Linear(16 * 7 * 9 + 32, actions)

    def forward(self, observation):
        camera = self.camera(observation["STEREO_CAMERAS"].float() / 255)
        return self.head(torch.cat((camera, self.lidar(observation["LIDAR"])), dim=1))


def batch(observations):
    return {key: torch.as_tensor(np.stack([one[key] for one in observations])).to(device) for key in observations[0]}


env = gym.make("deepracer-v0")
online, target = QNetwork(env.action_space.n).to(device), QNetwork(env.action_space.n).to(device)
target.load_state_dict(online.state_dict())
optimizer, replay, losses = torch.optim.Adam(online.parameters(), 1e-3), deque(maxlen=200), []
observation, info = env.reset(seed=1)
for step in range(120):
    epsilon = max(0.1, 1 - step / 100)
    if random.random() < epsilon:
        action = env.action_space.sample()
    else:
        with torch.no_grad():
            action = int(online(batch([observation])).argmax())
    following, reward, terminated, truncated, info = env.step(action)
    replay.append((observation, action, reward, following, terminated))
    observation = env.reset()[0] if terminated or truncated else following
    if len(replay) >= 32 and step % 8 == 0:
        states, actions, rewards, nexts, ends = map(list, zip(*random.sample(replay, 16), strict=True))
        with torch.no_grad():
            best = target(batch(nexts)).max(dim=1).values
        wanted = torch.tensor(rewards).to(device) + 0.99 * best * (1 - torch.tensor(ends).float())
        found = online(batch(states)).gather(1, torch.tensor(actions)[:, None])[:, 0]
        loss = nn.functional.smooth_l1_loss(found, wanted.float())
        optimizer.zero_grad(), loss.backward(), optimizer.step()
        losses.append(loss.item())
    if step % 40 == 0:
        target.load_state_dict(online.state_dict())
env.close()
print("done", len(losses) > 8, np.isfinite(losses).all(), deepracer.running())

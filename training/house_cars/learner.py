"""Trains one house car with PPO."""

import sys
import time
from dataclasses import dataclass
from typing import Any, cast

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import DummyVecEnv

from ..trainer.network import NetworkLayout, to_onnx
from ..trainer.torso import Torso
from ..trainer.warm_up import torso_arguments
from .environment import ROUTES, Score, make_env, score
from .recipes import Recipe

LOOK_EVERY = 20_000  # control steps between two looks at what the car can do


@dataclass(frozen=True)
class Trained:
    onnx: bytes
    steps: int  # when the best was seen
    steps_in_all: int
    seconds: float
    score: Score


def train(recipe: Recipe, *, seed: int, seconds: float | None = None) -> Trained:
    """Train on all routes for the recipe's steps, or until ``seconds`` of wall time are over, whichever is first.

    Every 20,000 steps the network as it is drives a lap of each route; the best one is kept. The same seed gives the
    same network on the same machine, unless the wall time ended it.
    """
    torch.set_num_threads(1)  # more threads spin against every other process of the machine
    routes = DummyVecEnv([make_env(recipe, slug, direction) for slug, direction in ROUTES])
    learner = PPO(
        "MlpPolicy",
        routes,
        learning_rate=lambda left: recipe.learning_rate * max(left, 0.1),
        n_steps=128,
        batch_size=256,
        n_epochs=recipe.epochs,
        gamma=recipe.gamma,
        gae_lambda=0.95,
        clip_range=0.2,
        ent_coef=recipe.entropy,
        policy_kwargs=policy_options(recipe) | {"log_std_init": recipe.log_std},
        seed=seed,
        device="cpu",
    )
    if recipe.first_action:
        with torch.no_grad():
            head: Any = learner.policy.action_net
            head.bias.copy_(torch.tensor(recipe.first_action))
    looks = _Looks(recipe, seconds)
    try:
        learner.learn(recipe.steps, callback=looks)
    finally:
        routes.close()
    looks.look()
    assert looks.best is not None
    onnx, steps, best = looks.best
    return Trained(onnx, steps, learner.num_timesteps, time.perf_counter() - looks.begun, best)


class _Looks(BaseCallback):
    def __init__(self, recipe: Recipe, seconds: float | None) -> None:
        super().__init__()
        self._recipe, self._seconds = recipe, seconds
        self._next = LOOK_EVERY
        self.begun = time.perf_counter()
        self.best: tuple[bytes, int, Score] | None = None

    def _on_step(self) -> bool:
        return self._seconds is None or time.perf_counter() - self.begun < self._seconds

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self._next += LOOK_EVERY
            self.look()

    def look(self) -> None:
        onnx = exported(self._recipe, cast(ActorCriticPolicy, self.model.policy))
        found = score(onnx, self._recipe.metadata, ROUTES)
        if self.best is None or found.key >= self.best[2].key:
            self.best = (onnx, self.num_timesteps, found)
        seconds = time.perf_counter() - self.begun
        print(
            f"{self._recipe.name}: {self.num_timesteps:>7} steps, {seconds:5.0f} s, "
            f"{found.clean}/{len(ROUTES)} routes clean, {found.distance:4.0%} of the way, {found.speed:.2f} m/s",
            file=sys.stderr,
            flush=True,
        )


def policy_options(recipe: Recipe) -> dict[str, object]:
    arguments = torso_arguments(NetworkLayout.of(recipe.metadata))
    return {"features_extractor_class": Torso, "features_extractor_kwargs": arguments, "net_arch": []}


def exported(recipe: Recipe, policy: ActorCriticPolicy) -> bytes:
    layout = NetworkLayout.of(recipe.metadata)
    weights = [*policy.features_extractor.parameters(), *policy.action_net.parameters()]
    arrays = (weight.detach().numpy() for weight in weights)
    return to_onnx(layout, dict(zip(layout.shapes, arrays, strict=True)), squash=False)

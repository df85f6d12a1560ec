"""Train a car on your own machine and pack it for the site: one file to read, copy and change.

    python training/examples/train_a_car.py --track oval --out car.zip

Sixteen cars drive in one simulator, PPO of stable-baselines3 learns from what they see, and the network is written as
an ONNX file beside its model_metadata.json: upload the zip, time it as the site would, or let this file send it:

    paddock evaluate car.zip --track oval
    python training/examples/train_a_car.py --track oval --submit https://your.site/races/...

It needs the package ``paddock-racing[training]``, or Paddock's checkout with what training needs (``make training``,
where the command is ``python -m paddock.cli``); to learn and to drive, no site, no broker, no database.
"""

from __future__ import annotations

import argparse
import io
import json
import sys
import time
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from paddock.simulator.envs.sb3 import SB3VecEnv  # the import registers the environments, too

CAMERA = "FRONT_FACING_CAMERA"
POOL = 4  # the network sees the mean of each 4 x 4 pixels: 30 rows of 40, which learns far faster than 120 x 160

# What the car can do and sees with: the file that goes into the package. Change the list, and train.
METADATA = {
    "action_space_type": "discrete",
    "action_space": [
        {"steering_angle": -30, "speed": 1.0},
        {"steering_angle": -15, "speed": 1.2},
        {"steering_angle": 0, "speed": 1.4},
        {"steering_angle": 15, "speed": 1.2},
        {"steering_angle": 30, "speed": 1.0},
    ],
    "sensor": [CAMERA],
    "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "training_algorithm": "clipped_ppo",
    "version": "4",
}


def reward_function(params: dict[str, Any]) -> float:
    """The nearer to the centre line, the more: it takes the place of the environment's own reward."""
    half_width = params["track_width"] / 2
    return max(1.0 - params["distance_from_center"] / half_width, 0.001)


class Cars(SB3VecEnv):
    """Paddock's vectorised environment as stable-baselines3 wants it: many cars, pictures pooled and channel first.

    Observations: uint8 (cars, 1, 30, 40). ``episodes``: reward and progress in percent of each episode that ended.
    """

    def __init__(self, cars: int, seed: int, **options: Any) -> None:
        """``options``: arguments of the environment, such as ``track``."""
        env = gymnasium.make_vec(
            "Paddock/TimeTrial-v1", num_envs=cars, autoreset_mode="Disabled", copy=False, observation="box", **options
        )
        picture = gymnasium.spaces.Box(0, 255, (1, 120 // POOL, 160 // POOL), np.uint8)
        super().__init__(env, seed=seed, observation_space=picture)
        self.episodes: list[tuple[float, float]] = []

    def look(self, frames: Any) -> np.ndarray:
        """What the learner sees of the cameras' frames."""
        return pooled(frames)

    def ended(self, number: int, info: dict[str, Any]) -> None:
        """Write down an episode."""
        self.episodes.append((info["episode"]["r"], info["progress"]))


def pooled(frames: np.ndarray) -> np.ndarray:
    """Frames (n, 120, 160, 1) as (n, 1, 30, 40): the means of 4 x 4 pixels, rounded down."""
    count, rows, columns, _ = frames.shape
    blocks = frames.reshape(count, 1, rows // POOL, POOL, columns // POOL, POOL)
    return (blocks.sum(axis=(3, 5), dtype=np.uint16) // POOL**2).astype(np.uint8)


class Eyes(BaseFeaturesExtractor):
    """A pooled picture to 128 features. stable-baselines3 has already divided it by 255."""

    def __init__(self, observation_space: gymnasium.Space) -> None:
        super().__init__(observation_space, features_dim=128)
        self.layers = nn.Sequential(
            nn.Conv2d(1, 16, 5, stride=2),
            nn.ReLU(),
            nn.Conv2d(16, 32, 3, stride=2),
            nn.ReLU(),
            nn.Flatten(),
            nn.Linear(32 * 6 * 8, 128),
            nn.ReLU(),
        )

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        return self.layers(picture)


class ProgressPrinter(BaseCallback):
    """Reports progress after each update and stops the training when it is good enough."""

    def __init__(self, enough: float, report: Callable[[str], None] = print) -> None:
        """``enough``: mean progress in percent of the last 40 episodes at which the training ends."""
        super().__init__()
        self.enough, self.report, self.began = enough, report, time.monotonic()

    def _on_rollout_start(self) -> None:
        reward, progress = self.lately()
        seconds = time.monotonic() - self.began
        self.report(
            f"{seconds:5.0f} s {self.num_timesteps:7d} steps   reward {reward:6.1f}   progress {progress:5.1f} %"
        )

    def _on_step(self) -> bool:
        return self.lately()[1] < self.enough

    def lately(self) -> tuple[float, float]:
        """Mean reward and progress of the last 40 episodes; zeros before there are 40."""
        episodes = cast("Cars", self.training_env).episodes[-40:]
        return tuple(np.mean(episodes, axis=0)) if len(episodes) == 40 else (0.0, 0.0)


def train(cars: Cars, steps: int, seed: int, enough: float = 97.0, report: Callable[[str], None] = print) -> PPO:
    """Learn for at most ``steps`` control steps (those of all cars together), or until ``enough`` percent of a lap is
    driven on average."""
    torch.set_num_threads(1)  # the network is too small to share out
    model = PPO(
        "CnnPolicy",
        cars,
        learning_rate=1e-3,
        n_steps=2000 // cars.num_envs,
        batch_size=250,
        n_epochs=4,
        gamma=0.97,
        ent_coef=0.01,
        policy_kwargs={"features_extractor_class": Eyes, "net_arch": []},
        seed=seed,
        device="cpu",
    )
    return model.learn(steps, callback=ProgressPrinter(enough, report))


class Driver(nn.Module):
    """What races: the raw frame in, a score for each action out. All preprocessing is inside."""

    def __init__(self, model: PPO) -> None:
        super().__init__()
        self.eyes, self.head = model.policy.features_extractor, model.policy.action_net

    def forward(self, frame: torch.Tensor) -> torch.Tensor:
        return self.head(self.eyes(nn.functional.avg_pool2d(frame, POOL) / 255.0))


def export(model: PPO, package: Path, metadata: Mapping[str, object] = METADATA) -> None:
    """Write the package: the network by the ONNX contract (docs/formats.md) and ``model_metadata.json``, in a zip."""
    network = io.BytesIO()
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # the newer exporter needs onnxscript
        torch.onnx.export(
            Driver(model).eval(),
            (torch.zeros(1, 1, 120, 160),),
            network,  # type: ignore[arg-type]  # the older exporter writes into any file
            input_names=[CAMERA],  # each input is named as its sensor
            output_names=["actions"],
            opset_version=17,
            dynamo=False,
            external_data=False,
        )
    with zipfile.ZipFile(package, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("model.onnx", network.getvalue())
        archive.writestr("model_metadata.json", json.dumps(metadata, indent=2))


def drive(package: Path, laps: int = 3, **options: Any) -> dict[str, Any]:
    """Race the packed network as the site does: from standing, without exploring. The last info of the run."""
    import onnxruntime

    with zipfile.ZipFile(package) as archive:
        network = onnxruntime.InferenceSession(archive.read("model.onnx"))
        metadata = json.loads(archive.read("model_metadata.json"))
    env = gymnasium.make(
        "Paddock/TimeTrial-v1", metadata=metadata, laps=laps, max_resets=20, max_simulated_ms=180_000, **options
    )
    readings, info = env.reset()
    over = False
    while not over:
        frame = readings[CAMERA].transpose(2, 0, 1)[None].astype(np.float32)
        scores = network.run(None, {CAMERA: frame})[0]
        readings, _, terminated, truncated, info = env.step(int(scores.argmax()))
        over = terminated or truncated
    env.close()
    return info


def submit(package: Path, race: str) -> int:
    """Send the package to a race, wait, and show the result; the exit status of the command ``paddock``. Say ``paddock
    login`` once before."""
    from paddock.cli.main import main as paddock

    return paddock(["submit", str(package), race, "--wait"])


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = argparse.ArgumentParser(description="Train a car and pack it for the site.")
    parser.add_argument("--track", default="oval", help="a name of the catalogue or an .npy file (default: oval)")
    parser.add_argument("--direction", default="ccw", choices=("ccw", "cw"))
    parser.add_argument("--steps", type=int, default=150_000, help="control steps of all cars at most")
    parser.add_argument("--cars", type=int, default=16)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("car.zip"))
    parser.add_argument("--submit", default="", metavar="RACE", help="the address of a race's page: send the car there")
    asked = parser.parse_args(arguments)

    where = {"track": asked.track, "direction": asked.direction}
    cars = Cars(asked.cars, asked.seed, **where, start="random", metadata=METADATA, reward_function=reward_function)
    model = train(cars, asked.steps, asked.seed)
    cars.close()
    export(model, asked.out)
    ran = drive(asked.out, **where)
    for lap in ran["laps"]:
        print(f"lap {lap['number']}: {lap['time_ms'] / 1000:.3f} s, {lap['resets']} resets, {lap['status'].lower()}")
    print(f"packed: {asked.out}")
    return submit(asked.out, asked.submit) if asked.submit else 0


if __name__ == "__main__":
    sys.exit(main())

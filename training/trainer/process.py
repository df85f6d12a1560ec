"""The training, inside the sandbox: stable-baselines3 on the vectorised simulator. Started by :mod:`.client`.

Everything it needs is imported at the top: a locked process opens no file. It says ``{"ready": versions}``, reads
``{"spec": ..., "start": "" | "weights" | "checkpoint"}`` (the latter with a blob), and then writes, until it ends:

- ``{"iteration": {...}, "driving": [...]}`` with two blobs: the network as ONNX, and a gzipped sim-trace (or nothing);
- ``{"alive": {"steps", "seconds", "reward_ms"}}`` about once a second; ``reward_ms``: of a call of the reward function,
  on the average (null before the first);
- ``{"printed": {"kept", "last", "more"}}`` with it, where the reward function has printed anything
  (:meth:`training.rewards.watch.Watch.news`);
- ``{"seen": {"steering", "speed", "value"}}`` about as often while it drives, with one blob: what a car's camera sees
  now, grey (120, 160), and what the policy would do, without exploring;
- ``{"checkpoint": {"iteration", "steps", "seconds"}}`` with one blob, which is only ever given back to this module;
- ``{"done": why, "steps", "seconds", "reward_ms"}`` with the stable-baselines3 file, and with the network where there
  was no iteration; or ``{"error": {"code", "params"}}``.

``{"stop": true}`` at any time ends it after the present control step, or in its midst where the reward function is
slow. The reward function may do in this process what
it likes; that is why nothing here is believed outside.
"""

from __future__ import annotations

import contextlib
import io
import json
import select
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any

from . import lean  # isort: skip  before everything that imports torch

import cv2
import numpy as np
import onnx  # noqa: F401  used in .network, which workers import without it
import stable_baselines3
import torch
from stable_baselines3.common.callbacks import BaseCallback

from evaluation.sandbox.frames import MAX_NETWORK, read_message, write_message
from paddock.errors import PaddockError, UserFault
from paddock.geometry.track import TrackGeometry
from paddock.simulator.action import ActionSpace
from paddock.simulator.rewards import RewardFunction, follow_centre_line
from paddock.simulator.world import make_ready
from training.rewards.function import fault_in, load_rewards
from training.rewards.modules import preload
from training.rewards.watch import Halted, arm, watch

from .cars import TrainingCars
from .judging import Judge
from .learners import Learner
from .messages import GREATEST
from .mirror import Mirror, Twin
from .network import OURS, NetworkLayout, from_onnx, to_onnx
from .pace import LEFT_S, Pace
from .senses import look
from .spec import CARS, TrainerSpec
from .warm import warm_up

cv2.setNumThreads(1)

CHECKPOINT_EVERY_S = 10.0
LARGE_CHECKPOINT_EVERY_S = 60.0  # of a network of the console: 70 MB each
PULSE_S = 1.0
MOST_PROBES = 4  # a look is put off for at most so many times, less one, if the car fails where it failed before
EVERY_UPDATE = 100  # so many updates are looked at one by one; then ever fewer of them, about 1 % of the way apart
CLEAN, TIME, STEPS, ASKED = "clean_laps", "time", "steps", "stopped"


def main(frames_in: int, frames_out: int) -> None:
    """Run one training; see the module."""
    make_ready()
    write_message(
        frames_out, {"ready": {"torch": torch.__version__, "stable-baselines3": stable_baselines3.__version__}}
    )
    message, blobs = read_message(frames_in, blob_limit=MAX_NETWORK)  # one of another layout is refused by its layout
    try:
        training = Training(TrainerSpec.from_dict(message["spec"]), frames_in, frames_out)
        training.begin(message.get("start", ""), blobs[0] if blobs else b"")
        training.run()
    except MemoryError:
        raise
    except PaddockError as fault:
        _tell_prints(frames_out, over=True)  # what it said before it failed is what its writer looks for
        write_message(frames_out, {"error": {"code": fault.code, "params": fault.params}})
    except Exception as error:
        traceback.print_exc()  # for operators, on stderr
        theirs = fault_in(error)  # of theirs, put in the place of something of ours
        if theirs is not None:
            _tell_prints(frames_out, over=True)
            write_message(frames_out, {"error": {"code": theirs.code, "params": theirs.params}})
            return
        detail = f"{type(error).__name__}: {error}"[:500]
        write_message(frames_out, {"error": {"code": "trainer_error", "params": {"detail": detail}}})


class Training:
    """One training from its specification to its end."""

    def __init__(self, spec: TrainerSpec, frames_in: int, frames_out: int) -> None:
        self.began = time.monotonic()
        self.spec = spec
        self._out = frames_out
        self._poller = select.poll()
        self._poller.register(frames_in, select.POLLIN)
        self.layout = NetworkLayout.of(spec.metadata, spec.build)
        self._senses = list(self.layout.senses)
        self._track = TrackGeometry.from_trusted_dict(spec.track)
        self.number = self._looked_at = 0  # the iteration, and the update that it looked at
        self._updates = 0
        self._best: tuple[float, ...] | None = None
        self._ended = ""
        self._looked = False  # at the car, since this process began
        self._loaded = False  # the reward functions
        self._pace = Pace(self._must_end, self._pulse)
        watch.must_halt = self._pace.must_halt
        self._saved = self.began
        self._told_at, self._told_steps = self.began, 0
        self._pulse_at = self._seen_at = self.began
        self._space = ActionSpace.from_metadata(spec.metadata)
        self._camera = next(sense.name for sense in self._senses if sense.spec.is_picture)

    @property
    def seconds(self) -> float:
        """Wall seconds of this training, with those of earlier attempts."""
        return self.spec.seconds_before + time.monotonic() - self.began

    def begin(self, start: str, blob: bytes) -> None:
        """Build cars and learner; ``start`` names what ``blob`` is. Raises UserFault of the reward function, and
        ``clone_not_ours`` for a network that is built in another way."""
        state = torch.load(io.BytesIO(blob), weights_only=True) if start == "checkpoint" else None
        # A training that goes on draws other starts than the one before it.
        seed = self.spec.seed if state is None else self.spec.seed + 1_000_003 * int(state["number"])
        mirror = Mirror.of(self.spec, self.layout)
        rewards = self._rewards(CARS + self.spec.trials_driven + (mirror is not None))
        if mirror is not None:
            rewards[0] = Twin(rewards[0], rewards.pop(), mirror)
        self._cars = TrainingCars(self.spec, self._track, rewards[:CARS], self._senses, seed)
        self._judge = Judge(self.spec, self._track, rewards[CARS:], self._senses, self._pulse)
        self._learner = Learner(
            self.spec, self.layout, self._cars, _Watch(self._may_go_on), self._hurry, mirror, self._share
        )
        if start == "weights":
            self._learner.take(_weights(self.layout, blob))
        if state is not None:
            self._learner.restore(state["learner"])
            self.number, self._updates = int(state["number"]), int(state["updates"])
            self._looked_at, self._cars.episode = self._updates, int(state["episode"])
            self._cars.drills.restore(state.get("drills") or self._cars.drills.state())
            if self._cars.scale is not None and state.get("scale"):
                self._cars.scale.restore(state["scale"])
            else:
                self._cars.scale = None  # it began with rewards as they are paid, and its values are of their size
            self._best = tuple(state["best"]) if state["best"] is not None else None
            self._told_steps = self._learner.model.num_timesteps
            torch.manual_seed(seed)
            np.random.seed(seed % 2**32)

    def _rewards(self, count: int) -> list[RewardFunction]:
        """As many reward functions as there are cars. Where the training ends before they are loaded, others stand in
        their place, and nothing is driven. Raises UserFault."""
        began = time.thread_time()
        try:
            rewards = reward_functions(self.spec.reward_code, count)
        except Halted:
            if self._ended == TIME:
                passed = 1000.0 * (time.thread_time() - began)
                raise UserFault("reward_slow_to_load", ms=round(passed), count=count) from None
            return [follow_centre_line] * count
        self._loaded = True
        return [self._pace.measured(reward) for reward in rewards]

    def run(self) -> None:
        """Drive, learn and look until something ends it."""
        learner = self._learner
        with contextlib.suppress(Halted):
            self._learn()
        if self._loaded and not self._looked and self._pace.leaves_time(self.spec.trials_driven):
            self._pace.allow(LEFT_S)
            with contextlib.suppress(Halted):
                self._look(None)  # stopped at once: what there is is a model all the same
        # a step that was halted among its rewards was driven
        steps = learner.model.num_timesteps or (CARS if self._loaded else 0)
        done = {"done": self._ended or TIME, "steps": steps, "seconds": self.seconds, "reward_ms": self._pace.call_ms}
        network = [] if self._looked else [to_onnx(self.layout, learner.weights(), squash=learner.sac)]
        _tell_prints(self._out, over=True)
        write_message(self._out, done, [learner.to_zip(), *network])
        self._cars.close()
        self._judge.close()

    def _learn(self) -> None:
        """Drive, learn and look in turn. Raises Halted in the midst of driving, where the training ends."""
        learner = self._learner
        self._end_if_steps_are_up()  # of one that goes on from its checkpoint
        while not self._ended and self._with_numbers(learner.drive):
            losses = self._with_numbers(learner.update)
            self._updates += 1
            every = self.spec.updates_a_look * (1 + self._updates // EVERY_UPDATE)
            since = self._updates - self._looked_at
            if self._steps_are_up() or since >= MOST_PROBES * every or (since >= every and self._passes_probe()):
                self._look(losses)
            self._end_if_steps_are_up()
            if self._ended or not self._may_go_on():
                break

    def _with_numbers(self, act: Callable[[], Any]) -> Any:
        """What ``act`` returns. Raises UserFault ``training_diverged`` where the weights are no numbers any more."""
        try:
            result = act()
        except PaddockError:
            raise
        except Exception:  # torch draws from no such distribution, and says so in ways of its own
            if self._learner.is_finite():
                raise
        else:
            if self._learner.is_finite():
                return result
        raise UserFault("training_diverged")

    def _may_go_on(self) -> bool:
        """Asked after each control step; writes down why not. How far it drives is the learner's own reckoning."""
        self._pulse()
        self._tell_sight()
        self._must_end()
        return not self._ended

    def _must_end(self) -> bool:
        """Whether somebody wants it to stop, or its time is up; writes down which."""
        if self._poller.poll(0):
            self._ended = ASKED
        elif self.seconds >= self.spec.stop_seconds:
            self._ended = TIME
        return bool(self._ended)

    def _share(self) -> float:
        """How much of the training is over: of its steps where these are limited, else of its time."""
        if self.spec.stop_steps is not None:
            return self._learner.model.num_timesteps / self.spec.stop_steps
        return self.seconds / self.spec.stop_seconds

    def _hurry(self) -> bool:
        """Asked between the steps of learning: whether somebody wants it to stop, or its time is up. An update of a
        large network takes half a minute."""
        self._pulse()
        return bool(self._poller.poll(0)) or self.seconds >= self.spec.stop_seconds

    def _pulse(self) -> None:
        """Tell about once a second that it goes on; called in everything that takes long."""
        now = time.monotonic()
        if now - self._pulse_at >= PULSE_S:
            self._pulse_at = now
            about = {
                "steps": self._learner.model.num_timesteps,
                "seconds": self.seconds,
                "reward_ms": self._pace.call_ms,
            }
            write_message(self._out, {"alive": about})
            _tell_prints(self._out)

    def _tell_sight(self) -> None:
        """Tell about once a second what the first car sees and what the policy makes of it. It draws nothing, so that
        whether somebody looks on changes no training."""
        now = time.monotonic()
        if now - self._seen_at < PULSE_S:
            return
        self._seen_at = now
        readings = {name: reading[None] for name, reading in self._cars.env.readings(0).items()}
        row = look(self._senses, readings)
        output, value = self._learner.consider(row)
        if not np.isfinite(output).all():
            return  # the update that follows says so
        if self._cars.scale is not None:
            value /= self._cars.scale.factor
        action = self._space.decode(output)
        sight = {
            "steering": round(action.steering_deg, 2),
            "speed": round(action.speed_mps, 3),
            "value": _told(value),
        }
        write_message(self._out, {"seen": sight}, [np.ascontiguousarray(readings[self._camera][0, :, :, 0]).tobytes()])

    def _steps_are_up(self) -> bool:
        return self.spec.stop_steps is not None and self._learner.model.num_timesteps >= self.spec.stop_steps

    def _end_if_steps_are_up(self) -> None:
        if not self._ended and self._steps_are_up():
            self._ended = STEPS

    def _passes_probe(self) -> bool:
        """Whether the car takes the places where the last look saw it fail: then it is worth another look."""
        failed = self._judge.probe(self._learner.act)
        self._cars.drills.note_looks(failed)
        return not failed

    def _look(self, losses: Any) -> None:
        learner = self._learner
        self._pace.allow(LEFT_S)
        verdict = self._judge.look(learner.act)
        self._pace.allow(0.0)
        self._cars.drills.note_looks(verdict.faults)
        key = verdict.key(self.spec.best_metric)
        best = self._best is None or key >= self._best
        if best:
            self._best = key
        if verdict.confirmed:
            self._ended = CLEAN
        self.number += 1
        self._looked = True
        self._looked_at = self._updates
        episodes, simtrace = self._cars.harvest()
        now, steps = time.monotonic(), learner.model.num_timesteps
        iteration = {
            "number": self.number,
            "steps": steps,
            "seconds": round(self.seconds, 3),
            "steps_per_second": round((steps - self._told_steps) / max(now - self._told_at, 1e-6), 1),
            "episodes": episodes[-200:],
            "mean_reward": _mean(episodes, "reward"),
            "mean_progress": _mean(episodes, "progress"),
            "eval_trials": verdict.trials,
            "eval_progress": round(verdict.progress, 3),
            "eval_reward": round(verdict.reward, 4),
            "eval_lap_ms": verdict.lap_ms,
            "eval_clean_laps": verdict.clean_laps,
            "entropy": losses and _told(losses.entropy),
            "policy_loss": losses and _told(losses.policy),
            "value_loss": losses and _told(losses.value),
            "is_best": best,
            "confirmed": verdict.confirmed,
        }
        self._told_at, self._told_steps = now, steps
        network = to_onnx(self.layout, learner.weights(), squash=learner.sac)
        write_message(self._out, {"iteration": iteration, "driving": verdict.driving}, [network, simtrace])
        every = CHECKPOINT_EVERY_S if self.spec.build == OURS else LARGE_CHECKPOINT_EVERY_S
        if self.number == 1 or now - self._saved >= every:
            self._save()

    def _save(self) -> None:
        self._saved = time.monotonic()
        state = {
            "learner": self._learner.state(),
            "number": self.number,
            "updates": self._updates,
            "episode": self._cars.episode,
            "drills": self._cars.drills.state(),
            "scale": self._cars.scale and self._cars.scale.state(),
            "best": None if self._best is None else [float(value) for value in self._best],
        }
        file = io.BytesIO()
        torch.save(state, file)
        about = {"iteration": self.number, "steps": self._learner.model.num_timesteps, "seconds": self.seconds}
        write_message(self._out, {"checkpoint": about}, [file.getvalue()])


class _Watch(BaseCallback):
    """Lets the learner ask after each control step whether it may go on."""

    def __init__(self, may_go_on: Callable[[], bool]) -> None:
        super().__init__()
        self._may_go_on = may_go_on

    def _on_step(self) -> bool:
        return self._may_go_on()


def reward_functions(code: str, count: int) -> list[RewardFunction]:
    """As many functions as there are cars: one may keep something from step to step. Raises UserFault."""
    if not code:
        return [follow_centre_line] * count
    return list(load_rewards(code, count))


def _tell_prints(frames_out: int, *, over: bool = False) -> None:
    """Tell what the reward function has printed since the last time."""
    news = watch.news(over=over)
    if news is not None:
        write_message(frames_out, {"printed": news})


def _weights(layout: NetworkLayout, onnx_bytes: bytes) -> dict[str, np.ndarray]:
    try:
        return from_onnx(layout, onnx_bytes)
    except (ValueError, LookupError) as error:  # a network of another build
        raise UserFault("clone_not_ours") from error


def _told(value: float) -> float | None:
    """A loss or a value as it can be told; the square of a great reward may be beyond it."""
    return value if abs(value) <= GREATEST else None


def _mean(episodes: list[dict[str, Any]], key: str) -> float | None:
    return round(sum(one[key] for one in episodes) / len(episodes), 4) if episodes else None


def _before_the_lock(planned: str, modules: str) -> None:
    """What a locked process could not do any more; see :mod:`.warm` and ``training.rewards``."""
    warm_up(json.loads(planned))
    preload(modules.split(",") if modules else ())
    arm()


if sys.argv[0] == __name__:  # started in the sandbox: nothing of the stranger's is here yet
    _before_the_lock(*sys.argv[1:3])
assert lean

"""The sandboxed training process: stable-baselines3 on the vectorised simulator, started by :mod:`.client`.

Everything it needs is imported at the top: a locked process opens no file. It sends ``{"ready": versions}``, reads
``{"spec": ..., "start": "" | "weights" | "checkpoint"}`` (the latter with a blob), and then writes, until it ends:

- ``{"iteration": IterationReport, "driving": [...]}`` with two blobs: the network as ONNX, and a gzipped sim-trace or
  nothing;
- ``{"alive": {"steps", "seconds", "reward_ms"}}`` about once a second; ``reward_ms``: see :class:`.messages.Ended`;
- ``{"printed": {"kept", "last", "more"}}``, see :class:`.messages.Prints`;
- ``{"seen": {"steering", "speed", "value"}}`` with one blob, see :class:`.messages.Sight`;
- ``{"checkpoint": {"iteration", "steps", "seconds"}}`` with one blob, which only this module reads;
- ``{"done": why, "steps", "seconds", "reward_ms"}`` with the stable-baselines3 file, and with the network where there
  was no iteration; or ``{"error": {"code", "params"}}``.

``{"stop": true}`` at any time ends it after the present control step, or within it where the reward function is slow.
The reward function controls this process, so its messages are untrusted outside.
"""

import contextlib
import io
import json
import select
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any, cast

from . import torch_imports  # isort: skip  before everything that imports torch

import cv2
import numpy as np
import onnx  # noqa: F401  used in .network, which workers import without it
import stable_baselines3
import torch
from stable_baselines3.common.callbacks import BaseCallback

from evaluation.sandbox.frames import MAX_NETWORK, read_message, write_message
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.geometry.track import TrackGeometry
from paddock.simulator.action import ActionSpace
from paddock.simulator.rewards import RewardFunction, follow_centre_line
from paddock.simulator.world import make_ready
from training.rewards.sandbox.allowed_modules import preload
from training.rewards.sandbox.call_limits import Halted, arm, watch
from training.rewards.sandbox.function import fault_in, load_rewards

from .cars import TrainingCars
from .learners import Learner, Losses
from .messages import GREATEST, IterationReport
from .mirror_augmentation import Mirror, Twin
from .network import OURS, NetworkLayout, from_onnx, to_onnx
from .observations import look
from .policy_evaluation import Judge
from .reward_timing import LEFT_S, Pace
from .spec import CARS, TrainerSpec
from .warm_up import warm_up

cv2.setNumThreads(1)

CHECKPOINT_EVERY_S = 10.0
LARGE_CHECKPOINT_EVERY_S = 60.0  # of a network of the console: 70 MB each
PULSE_S = 1.0
MOST_PROBES = 4  # an evaluation is put off at most so many times, less one, if the car fails where it failed before
EVERY_UPDATE = 100  # so many updates are evaluated one by one, later ones about 1 % of the way apart
CLEAN, TIME, STEPS, ASKED = "clean_laps", "time", "steps", "stopped"


def main(frames_in: int, frames_out: int) -> None:
    make_ready()
    versions = {"torch": torch.__version__, "stable-baselines3": stable_baselines3.__version__}
    write_message(frames_out, {"ready": versions})
    message, blobs = read_message(frames_in, blob_limit=MAX_NETWORK)  # one of another layout is refused by its layout
    try:
        training = Training(TrainerSpec(**message["spec"]), frames_in, frames_out)
        training.begin(message.get("start", ""), blobs[0] if blobs else b"")
        training.run()
    except MemoryError:
        raise
    except Exception as error:
        if issubclass(type(error), PaddockError):  # isinstance would ask the object, which may be the racer's
            fault: PaddockError | None = cast("PaddockError", error)
        else:
            traceback.print_exc()  # for operators, on stderr
            fault = fault_in(error)  # the racer's code may have replaced something of ours
        if fault is None:
            fault = PlatformFault("trainer_error", detail=f"{type(error).__name__}: {error}"[:500])
        else:
            _send_prints(frames_out, over=True)  # the output before the failure
        write_message(frames_out, {"error": {"code": fault.code, "params": fault.params}})


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
        self._saved_number = 0
        self._updates = 0
        self._best: tuple[float, ...] | None = None
        self._ended = ""
        self._looked = False  # whether this process has evaluated the policy
        self._loaded = False  # whether it has loaded the reward functions
        self._pace = Pace(self._must_end, self._pulse)
        watch.must_halt = self._pace.must_halt
        self._saved = self.began
        self._reported_at, self._reported_steps = self.began, 0
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
        guided = self.spec.guided and start == "" if state is None else bool(state["learner"].get("guide"))
        self._cars = TrainingCars(self.spec, self._track, rewards[:CARS], self._senses, seed, guided)
        self._judge = Judge(self.spec, self._track, rewards[CARS:], self._senses, self._pulse)
        self._learner = Learner(
            *(self.spec, self.layout, self._cars, _Watch(self._may_go_on), self._hurry, mirror, self._share, guided)
        )
        if start == "weights":
            try:
                self._learner.take(from_onnx(self.layout, blob))
            except (ValueError, LookupError) as error:  # a network of another build
                raise UserFault("clone_not_ours") from error
        if state is not None:
            self._learner.restore(state["learner"])
            self.number, self._updates = int(state["number"]), int(state["updates"])
            self._looked_at, self._cars.episode = self._updates, int(state["episode"])
            self._saved_number = self.number
            self._cars.drills.restore(state.get("drills") or self._cars.drills.state())
            if self._cars.scale is not None and state.get("scale"):
                self._cars.scale.restore(state["scale"])
            else:
                self._cars.scale = None  # its values were learned from rewards that were not scaled
            self._best = tuple(state["best"]) if state["best"] is not None else None
            self._reported_steps = self._learner.model.num_timesteps
            torch.manual_seed(seed)
            np.random.seed(seed % 2**32)

    def _rewards(self, count: int) -> list[RewardFunction]:
        """One reward function for each car; one may keep values from step to step. Where the training ends before they
        are loaded, the default stands in their place, and nothing is driven. Raises UserFault."""
        began = time.thread_time()
        try:
            code = self.spec.reward_code
            rewards = list(load_rewards(code, count)) if code else [follow_centre_line] * count
        except Halted:
            if self._ended == TIME:
                passed = 1000.0 * (time.thread_time() - began)
                raise UserFault("reward_slow_to_load", ms=round(passed), count=count) from None
            return [follow_centre_line] * count
        self._loaded = True
        return [self._pace.measured(reward) for reward in rewards]

    def run(self) -> None:
        """Drive, learn and evaluate until the training ends."""
        learner = self._learner
        with contextlib.suppress(Halted):
            self._learn()
        if self._loaded and not self._looked and self._pace.leaves_time(self.spec.trials_driven):
            self._pace.allow(LEFT_S)
            with contextlib.suppress(Halted):
                self._look(None)  # stopped at once: the policy is a model all the same
        if self.spec.continues and self.number > self._saved_number:
            self._save()
        # a step that was halted among its rewards was driven
        steps = learner.model.num_timesteps or (CARS if self._loaded else 0)
        done = {"done": self._ended or TIME, "steps": steps, "seconds": self.seconds, "reward_ms": self._pace.call_ms}
        network = [] if self._looked else [to_onnx(self.layout, learner.weights(), squash=learner.sac)]
        _send_prints(self._out, over=True)
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
        """The result of ``act``. Raises UserFault ``training_diverged`` where a weight is NaN or infinite."""
        try:
            result = act()
        except PaddockError:
            raise
        except Exception:  # torch raises various types for such distributions
            if self._learner.is_finite():
                raise
        else:
            if self._learner.is_finite():
                return result
        raise UserFault("training_diverged")

    def _may_go_on(self) -> bool:
        """Called after each control step; records why the training must end."""
        self._pulse()
        self._send_sight()
        self._must_end()
        return not self._ended

    def _must_end(self) -> bool:
        """Whether a stop was requested or its time is up; records which."""
        if self._poller.poll(0):
            self._ended = ASKED
        elif self.seconds >= self.spec.stop_seconds:
            self._ended = TIME
        return bool(self._ended)

    def _share(self) -> float:
        """The share of the training that is over: of its steps where these are limited, else of its time."""
        if self.spec.stop_steps is not None:
            return self._learner.model.num_timesteps / self.spec.stop_steps
        return self.seconds / self.spec.stop_seconds

    def _hurry(self) -> bool:
        """Called between the steps of learning, because an update of a large network takes half a minute: whether a
        stop was requested or the time is up."""
        self._pulse()
        return bool(self._poller.poll(0)) or self.seconds >= self.spec.stop_seconds

    def _pulse(self) -> None:
        """Send a sign of life about once a second; called in every long operation."""
        now = time.monotonic()
        if now - self._pulse_at >= PULSE_S:
            self._pulse_at = now
            about = {"steps": self._learner.model.num_timesteps, "seconds": self.seconds}
            write_message(self._out, {"alive": {**about, "reward_ms": self._pace.call_ms}})
            _send_prints(self._out)

    def _send_sight(self) -> None:
        """Send about once a second the first car's picture and the policy's output. It draws no random numbers, so
        watching changes no training."""
        now = time.monotonic()
        if now - self._seen_at < PULSE_S:
            return
        self._seen_at = now
        readings = {name: reading[None] for name, reading in self._cars.env.readings(0).items()}
        row = look(self._senses, readings)
        output, value = self._learner.consider(row)
        if not np.isfinite(output).all():
            return  # the next update reports it
        if self._cars.scale is not None:
            value /= self._cars.scale.factor
        action = self._space.decode(output)
        sight = {"steering": round(action.steering_deg, 2), "speed": round(action.speed_mps, 3)}
        picture = np.ascontiguousarray(readings[self._camera][0, :, :, 0]).tobytes()
        write_message(self._out, {"seen": {**sight, "value": _bounded(value)}}, [picture])

    def _steps_are_up(self) -> bool:
        return self.spec.stop_steps is not None and self._learner.model.num_timesteps >= self.spec.stop_steps

    def _end_if_steps_are_up(self) -> None:
        if not self._ended and self._steps_are_up():
            self._ended = STEPS

    def _passes_probe(self) -> bool:
        """Whether the car passes the places of its last faults, so that another evaluation is worth its time."""
        failed = self._judge.probe(self._learner.act)
        self._cars.drills.note_looks(failed)
        return not failed

    def _look(self, losses: Losses | None) -> None:
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
        iteration: IterationReport = {
            "number": self.number,
            "steps": steps,
            "seconds": round(self.seconds, 3),
            "steps_per_second": round((steps - self._reported_steps) / max(now - self._reported_at, 1e-6), 1),
            "episodes": episodes[-200:],
            "mean_reward": _mean([one["reward"] for one in episodes]),
            "mean_progress": _mean([one["progress"] for one in episodes]),
            "eval_trials": verdict.trials,
            "eval_progress": round(verdict.progress, 3),
            "eval_reward": round(verdict.reward, 4),
            "eval_lap_ms": verdict.lap_ms,
            "eval_clean_laps": verdict.clean_laps,
            "entropy": None if losses is None else _bounded(losses.entropy),
            "policy_loss": None if losses is None else _bounded(losses.policy),
            "value_loss": None if losses is None else _bounded(losses.value),
            "is_best": best,
        }
        self._reported_at, self._reported_steps = now, steps
        network = to_onnx(self.layout, learner.weights(), squash=learner.sac)
        write_message(self._out, {"iteration": iteration, "driving": verdict.driving}, [network, simtrace])
        every = CHECKPOINT_EVERY_S if self.spec.build == OURS else LARGE_CHECKPOINT_EVERY_S
        if self.number == 1 or now - self._saved >= every:
            self._save()

    def _save(self) -> None:
        self._saved, self._saved_number = time.monotonic(), self.number
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


def _send_prints(frames_out: int, *, over: bool = False) -> None:
    """Send the reward function's output since the last call."""
    news = watch.news(over=over)
    if news is not None:
        write_message(frames_out, {"printed": news})


def _bounded(value: float) -> float | None:
    """A loss or a value; None beyond the limit of a message, as the square of a large reward."""
    return value if abs(value) <= GREATEST else None


def _mean(values: list[float]) -> float | None:
    return round(sum(values) / len(values), 4) if values else None


if sys.argv[0] == __name__:  # started in the sandbox: before its lock, and before any code of the racer
    planned, modules = sys.argv[1:3]
    warm_up(json.loads(planned))
    preload(modules.split(",") if modules else ())
    arm()
assert torch_imports

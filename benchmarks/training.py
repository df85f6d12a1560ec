"""``python -m benchmarks.training [--json]``: how long a training takes from its start to a car that laps.

For each track and seed a training as the wizard makes it (the default centre-line reward, all defaults) runs behind the
sandbox, alone, until its car drives three clean laps in a row from the finish line: wall time from the call that starts
the process to its end, imports, learning and every evaluation included. Three laps through the platform's own
evaluation then confirm it. Times are medians over the seeds; ``cpu_s`` is the processor time of the same, which depends
less on what else the machine does.

Then, for each track and seed, from nothing to a car that is nearly as fast as the minimum-curvature line of the track
(:mod:`.racing_pace`); and SAC, with all its defaults, to its first three clean laps on the oval.

Environment steps a second are those of stable-baselines3's PPO gathering and learning: here (16 cars in one world) and,
in the same run, on Gymnasium's CarRacing. That one needs Box2D: ``pip install '.[bench]'``.

``--shared`` is for a machine that does other things: the five minutes of the racing line are then processor time. What
the keys of ``--json`` mean: docs/operators.md, "How fast trainings are".
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Callable, Collection
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from paddock.geometry.catalogue import CATALOGUE
from paddock.packages.metadata import MetadataDocument
from paddock.rules.hyperparameters import DEFAULTS
from paddock.simulator.physics import PADDOCK_CAR
from training.jobs.settings_checks import DEFAULT_ACTIONS, DEFAULT_BOUNDS
from training.rewards.examples import EXAMPLES
from training.trainer.client import Iteration, Listener, train
from training.trainer.spec import TrainerSpec

from . import racing_pace
from .machine import measured_on
from .processor import Clock
from .racing_pace import LAPS, clean_laps, track_of
from .report import command, report

MOST_S = {"oval": 20.0, "kuei-raceway": 30.0}  # what the platform promises
GIVE_UP_S = 600.0
SAC_TRACK = "oval"
PARTS = ("laps", "line", "sac")
METADATA: MetadataDocument = {
    "action_space_type": "discrete",
    "action_space": [dict(action) for action in DEFAULT_ACTIONS],
    "sensor": ["FRONT_FACING_CAMERA"],
    "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "training_algorithm": "clipped_ppo",
    "version": "5",
}


def wizard_spec(slug: str, seed: int, **changes: Any) -> TrainerSpec:
    """The training that the wizard makes when nothing is changed, until it laps cleanly."""
    defaults: dict[str, Any] = {
        "track": track_of(slug).to_dict(),
        "race_type": "time_trial",
        "metadata": METADATA,
        "algorithm": "ppo",
        "hyperparameters": dict(DEFAULTS["ppo"]),
        "reward_code": EXAMPLES[0].code,
        "stop_seconds": GIVE_UP_S,
        "stop_clean_laps": LAPS,
        "seed": seed,
    }
    return TrainerSpec(**(defaults | changes))


def sac_spec(slug: str, seed: int) -> TrainerSpec:
    """The same with SAC, whose actions are continuous: all its defaults, and those of the wizard's action space."""
    space = {name: dict(bounds) for name, bounds in DEFAULT_BOUNDS.items()}
    metadata = {
        **METADATA,
        "action_space_type": "continuous",
        "action_space": space,
        "training_algorithm": "sac",
    }
    return wizard_spec(slug, seed, metadata=metadata, algorithm="sac", hyperparameters=dict(DEFAULTS["sac"]))


class _Notes(Listener):
    """What one training told."""

    def __init__(self) -> None:
        self.ready_s = 0.0
        self.first_lap_s: float | None = None
        self.iterations: list[Iteration] = []
        self.clock = Clock()
        self._began = time.monotonic()

    def ready(self) -> None:
        self.ready_s = time.monotonic() - self._began
        self.clock.look()

    def iteration(self, iteration: Iteration) -> None:
        self.iterations.append(iteration)
        self.clock.look()  # the trainer is over, and its clock with it, when the training has ended
        if self.first_lap_s is None and iteration.values["eval_clean_laps"]:
            self.first_lap_s = time.monotonic() - self._began


def first_laps(slug: str, spec: TrainerSpec, weights: bytes = b"") -> dict[str, Any]:
    """One training to its first three clean laps. ``lap_s`` is the mean of the evaluation that confirms it.
    ``weights``: the canonical network that it starts from."""
    notes, began = _Notes(), time.monotonic()
    ended = train(spec, notes, start="weights" if weights else "", blob=weights)
    wall_s = time.monotonic() - began
    notes.clock.close()
    clean = clean_laps(slug, notes.iterations[-1].onnx, spec.metadata)
    return {
        "seed": spec.seed,
        "lapped": ended.why == "clean_laps",
        "wall_s": wall_s,
        "cpu_s": notes.clock.seconds,
        "start_s": notes.ready_s,
        "first_lap_s": notes.first_lap_s,
        "steps": ended.steps,
        "iterations": len(notes.iterations),
        "steps_per_second": statistics.median(one.values["steps_per_second"] for one in notes.iterations),
        "clean_laps_in_an_evaluation": len(clean),
        "lap_s": statistics.mean(clean) / 1000.0 if clean else None,
    }


def lapping(slug: str, make: Callable[[str, int], TrainerSpec], seeds: int) -> dict[str, Any]:
    """:func:`first_laps` for every seed, and medians."""
    runs = [first_laps(slug, make(slug, seed)) for seed in range(seeds)]
    medians = {
        name: statistics.median(one[name] for one in runs)
        for name in ("wall_s", "cpu_s", "start_s", "steps", "steps_per_second")
    }
    return {**medians, "lapped": sum(one["lapped"] for one in runs), "runs": runs}


def car_racing(steps: int) -> dict[str, Any] | None:
    """stable-baselines3's PPO with its own network for pictures on CarRacing, 8 environments; None without Box2D."""
    try:
        import Box2D  # noqa: F401
        import gymnasium
        import torch
        from stable_baselines3 import PPO
        from stable_baselines3.common.env_util import make_vec_env
    except ImportError:
        return None
    torch.set_num_threads(1)
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    environments = make_vec_env(lambda: gymnasium.make("CarRacing-v3"), n_envs=8, seed=0)
    learner = PPO("CnnPolicy", environments, n_steps=64, batch_size=256, n_epochs=4, seed=0, device="cpu")
    began, cpu = time.monotonic(), time.process_time()
    learner.learn(steps)
    wall_s, cpu_s = time.monotonic() - began, time.process_time() - cpu
    environments.close()
    return {"steps_per_second": learner.num_timesteps / wall_s, "steps_per_cpu_second": learner.num_timesteps / cpu_s}


def run(
    tracks: list[str],
    seeds: int,
    compared_steps: int,
    parts: Collection[str] = PARTS,
    shared: bool = False,
    speed_limit: float = racing_pace.SPEED_LIMIT_MPS,
    near: float = racing_pace.NEAR,
    budget_s: float = racing_pace.BUDGET_S,
) -> dict[str, Any]:
    """All figures as JSON values; those of parts that are left out are empty."""
    load = os.getloadavg()[0]
    first = {slug: lapping(slug, wizard_spec, seeds) for slug in tracks if "laps" in parts}
    line = {
        slug: racing_pace.measure(
            slug, wizard_spec, seeds, by_cpu=shared, speed_limit=speed_limit, near=near, budget_s=budget_s
        )
        for slug in tracks
        if "line" in parts
    }
    sac = {slug: lapping(slug, sac_spec, seeds) for slug in (SAC_TRACK,) if "sac" in parts}
    ours = statistics.median(one["steps_per_second"] for one in first.values()) if first else None
    # of whole trainings: their start and their evaluations are counted against us
    driven = [one["steps"] / one["cpu_s"] for found in first.values() for one in found["runs"]]
    per_cpu = statistics.median(driven) if driven else None
    other = car_racing(compared_steps) if compared_steps and ours else None
    return {
        "machine": measured_on(load),
        "seeds": seeds,
        "first_three_clean_laps": first,
        "near_the_racing_line": line,
        "first_three_clean_laps_of_sac": sac,
        "steps_per_second": {
            "paddock": ours,
            "car_racing": other and other["steps_per_second"],
            "ratio": other and ours / other["steps_per_second"],
            "paddock_per_cpu_s": per_cpu,
            "car_racing_per_cpu_s": other and other["steps_per_cpu_second"],
            "ratio_per_cpu_s": other and per_cpu / other["steps_per_cpu_second"],
        },
    }


def misses(figures: dict[str, Any]) -> list[str]:
    """The platform's promises that these figures break, one sentence each."""
    told = []
    for slug, found in figures["first_three_clean_laps"].items():
        most = MOST_S.get(slug)
        if found["lapped"] < figures["seeds"]:
            told.append(f"{slug}: {found['lapped']} of {figures['seeds']} trainings drove three clean laps")
        if most is not None and found["wall_s"] > most:
            told.append(f"{slug}: {found['wall_s']:.1f} s to three clean laps, {most:g} s are promised")
    for slug, found in figures["near_the_racing_line"].items():
        near = f"within {found['near'] - 1:.0%} of the racing line"
        if found["reached"] < figures["seeds"]:
            told.append(f"{slug}: {found['reached']} of {figures['seeds']} trainings came {near}")
        spent = found["cpu_s" if found["budget_in"] == "processor time" else "wall_s"]
        if spent is None or spent > found["budget_s"]:
            told.append(f"{slug}: not {near} in {found['budget_s']:g} s, as is promised")
    for slug, found in figures["first_three_clean_laps_of_sac"].items():
        if found["lapped"] < figures["seeds"]:
            told.append(f"{slug}: {found['lapped']} of {figures['seeds']} trainings of SAC drove three clean laps")
    return told


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine = figures["machine"]
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores, load {machine['load_before']} to {machine['load_after']}; "
        f"{machine['engine']}; medians of {figures['seeds']} seeds",
    ]
    titles = {
        "first_three_clean_laps": "From the start of a training to three clean laps, everything included",
        "first_three_clean_laps_of_sac": "The same with SAC and all its defaults",
    }
    for key, title in titles.items():
        if figures[key]:
            lines += ["", title, *_lapping_table(figures[key], figures["seeds"])]
    if figures["near_the_racing_line"]:
        lines += ["", *_line_table(figures["near_the_racing_line"], figures["seeds"])]
    speed = figures["steps_per_second"]
    if speed["car_racing"]:
        lines += [
            "",
            f"Environment steps a second while learning: {speed['paddock']:.0f} here, {speed['car_racing']:.0f} on "
            f"CarRacing ({speed['ratio']:.1f} times as many; of processor time {speed['ratio_per_cpu_s']:.1f} times)",
        ]
    elif speed["paddock"]:
        lines += [
            "",
            f"Environment steps a second while learning: {speed['paddock']:.0f} "
            "(CarRacing not measured: it needs Box2D, pip install '.[bench]')",
        ]
    missed = misses(figures)
    return "\n".join([*lines, "", "Every target is met." if not missed else "Missed: " + "; ".join(missed)])


def _lapping_table(figures: dict[str, Any], seeds: int) -> list[str]:
    lines = [f"{'':16}{'wall':>9}{'processor':>11}{'start':>8}{'steps':>8}{'steps/s':>9}{'lapped':>8}  seeds"]
    for slug, found in figures.items():
        each = " ".join(f"{one['wall_s']:.1f}" for one in found["runs"])
        lines.append(
            f"{slug:16}{found['wall_s']:>7.1f} s{found['cpu_s']:>9.1f} s{found['start_s']:>6.1f} s"
            f"{found['steps']:>8.0f}{found['steps_per_second']:>9.0f}{found['lapped']:>5}/{seeds}  {each}"
        )
    return lines


def _line_table(figures: dict[str, Any], seeds: int) -> list[str]:
    def cell(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    first = next(iter(figures.values()))
    limit, near = first["speed_limit_mps"], first["near"]
    lines = [
        f"From the start of a training to within {near - 1:.0%} of the lap of the minimum-curvature line, "
        f"both at {limit:g} m/s at most",
        f"{'':16}{'line':>9}{'wanted':>9}{'driven':>9}{'wall':>9}{'processor':>11}{'steps':>9}{'reached':>9}  seeds",
    ]
    for slug, found in figures.items():
        each = " ".join(f"{one['wall_s']:.0f}" if one["reached"] else "-" for one in found["runs"])
        lines.append(
            f"{slug:16}{found['line_lap_s']:>7.2f} s{found['wanted_lap_s']:>7.2f} s{cell(found['lap_s'], '.2f'):>7} s"
            f"{cell(found['wall_s'], '.1f'):>7} s{cell(found['cpu_s'], '.1f'):>9} s{cell(found['steps'], '.0f'):>9}"
            f"{found['reached']:>6}/{seeds}  {each}"
        )
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Measure and print. Returns 0 even where a target is missed: whoever reads the figures judges."""
    parser = command("training", "From nothing to three clean laps.")
    parser.add_argument(
        "--tracks", nargs="+", default=["oval", "kuei-raceway"], choices=[entry.slug for entry in CATALOGUE]
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--compared-steps", type=int, default=2048, help="on CarRacing; 0 leaves it out")
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS, help="what to measure")
    parser.add_argument("--shared", action="store_true", help="the machine does other things: see above")
    parser.add_argument(
        "--speed-limit", type=float, default=racing_pace.SPEED_LIMIT_MPS, help="m/s, of car and racing line"
    )
    parser.add_argument(
        "--near", type=float, default=racing_pace.NEAR, help="times the racing line's lap that are near enough"
    )
    parser.add_argument(
        "--budget", type=float, default=racing_pace.BUDGET_S, metavar="SECONDS", help="to come so near to it"
    )
    options = parser.parse_args(arguments)
    if options.near < 1.0 or options.budget <= 0.0:
        parser.error("--near: at least 1; --budget: more than 0 s")
    if not PADDOCK_CAR.min_speed <= options.speed_limit <= PADDOCK_CAR.max_speed:
        parser.error(f"--speed-limit: {PADDOCK_CAR.min_speed:g} to {PADDOCK_CAR.max_speed:g} m/s")
    figures = run(
        options.tracks,
        options.seeds,
        options.compared_steps,
        options.parts,
        options.shared,
        options.speed_limit,
        near=options.near,
        budget_s=options.budget,
    )
    return report(figures, as_json=options.json, table=table)


if __name__ == "__main__":
    sys.exit(main())

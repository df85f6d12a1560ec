"""Train house cars and measure them.

``python -m training.house_cars [NAME ...] [--seconds N] [--seed N] [--measure | --admit]``
"""

import argparse
import os
import sys
from importlib.metadata import version
from pathlib import Path

# Before numpy and torch start their threads: two that spin slow every other process on the machine.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from paddock.errors import PaddockError
from paddock.simulator.engine import ENGINE_ID, cpu_model, versions

from .files import FOLDER, LAPS, admit_car, measure_car, write_car, write_table
from .recipes import RECIPES, Recipe


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser("python -m training.house_cars", description="Train house cars and measure them.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which cars (default: all): {', '.join(RECIPES)}")
    parser.add_argument("--seconds", type=float, help="stop training each car after so many seconds of wall time")
    parser.add_argument("--seed", type=int, help="instead of the recipe's own seed")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the files go (default: this package)")
    parser.add_argument("--measure", action="store_true", help="only measure the cars that are there")
    parser.add_argument("--admit", action="store_true", help="only write again what their admission finds")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in RECIPES]
    if unknown:
        parser.error(f"no house car is named {unknown[0]!r}; there are {', '.join(RECIPES)}")
    try:
        for name in options.names or RECIPES:
            if not (options.measure or options.admit):
                make(RECIPES[name], options.folder, options.seed, options.seconds)
            if not options.admit:
                measured = measure_car(options.folder, name)
                drives = [found for ways in measured.values() for found in ways.values()]
                clean = sum(found["complete_laps"] == LAPS and not found["resets"] for found in drives)
                print(f"{name}: {clean} of {len(drives)} routes without a reset")
            admit_car(options.folder, name)
        write_table(options.folder)
    except PaddockError as fault:
        print(f"{fault.code}: {fault}", file=sys.stderr)
        return 1
    return 0


def make(recipe: Recipe, folder: Path, seed: int | None, seconds: float | None) -> None:
    """Train one car and write its files. Raises UserFault where the platform's gate refuses it."""
    try:
        from .learner import train
    except ModuleNotFoundError as missing:
        sys.exit(f"training needs {missing.name}: pip install 'paddock[training]'")
    seed = recipe.seed if seed is None else seed
    trained = train(recipe, seed=seed, seconds=seconds)
    command = f"python -m training.house_cars {recipe.name} --seed {seed}"
    made = {
        "command": command if seconds is None else f"{command} --seconds {seconds:g}",
        "seed": seed,
        "steps": trained.steps,
        "steps_in_all": trained.steps_in_all,
        "seconds": round(trained.seconds),
        "engine": ENGINE_ID,
        "versions": {**versions(), **{name: version(name) for name in ("torch", "stable-baselines3", "gymnasium")}},
        "cpu": cpu_model(),
    }
    write_car(folder, recipe, trained.onnx, made)


if __name__ == "__main__":
    sys.exit(main())

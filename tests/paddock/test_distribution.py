"""The racers' package: what is in the wheel, and that it works where nothing of the site is installed.

What it depends on is taken from this environment, distribution by distribution as the wheel's own metadata asks for it,
so that the test needs no network, and what the wheel does not ask for is not there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from scripts.package import build
from tests.shared import CHECKOUT

pytestmark = pytest.mark.slow
SITES_OWN = ("django", "celery", "rest_framework", "storages", "boto3", "psycopg", "accounts", "evaluation", "core")


def project(path: str) -> dict:
    return tomllib.loads((CHECKOUT / path).read_text())["project"]


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> dict[str, Path]:
    """Wheel and source archive, by their endings."""
    return {path.suffix: path for path in build(tmp_path_factory.mktemp("dist"))}


@pytest.fixture(scope="module")
def home(made, tmp_path_factory) -> Path:
    """An environment with the wheel and what it asks for, and nothing else."""
    folder = tmp_path_factory.mktemp("home")
    venv.create(folder, with_pip=False, symlinks=True)
    packages = next(folder.glob("lib/python*/site-packages"))
    for name in _asked_for(made[".whl"]):
        _link(metadata.distribution(name), packages)
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), "install", "--quiet"]
    subprocess.run([*pip, "--no-index", "--no-deps", str(made[".whl"])], check=True)
    return folder


def _asked_for(wheel: Path) -> set[str]:
    """All distributions that the wheel needs, by way of those that it names."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        lines = archive.read(name).decode().split("\n\n")[0].split("\n")
    asked = [line.removeprefix("Requires-Dist: ") for line in lines if line.startswith("Requires-Dist: ")]
    found: set[str] = set()
    while asked:
        wish = Requirement(asked.pop())
        if wish.name not in found and (wish.marker is None or wish.marker.evaluate({"extra": ""})):
            found.add(wish.name)
            asked += metadata.requires(wish.name) or []
    return found


def _link(distribution: metadata.Distribution, packages: Path) -> None:
    for top in {Path(str(file)).parts[0] for file in distribution.files or () if ".." not in Path(str(file)).parts}:
        source, target = Path(str(distribution.locate_file(top))), packages / top
        if source.exists() and not target.exists() and top != "__pycache__":
            target.symlink_to(source)


def run(home: Path, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess:
    clean = {name: os.environ[name] for name in ("HOME", "LANG") if name in os.environ}
    command = [str(home / "bin" / "python"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd or home, env=clean)


def test_the_wheel_holds_the_engine_and_nothing_else(made):
    names = zipfile.ZipFile(made[".whl"]).namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"paddock", "paddock_racing.pth"}
    inside = set(names)
    assert inside >= {
        "paddock/simulator/camera/warp.c",
        "paddock/geometry/catalogue/data/catalogue.csv",
        "paddock/geometry/catalogue/data/NOTICE",
        "paddock/cli/starter/train_a_car.py",
        "paddock/cli/starter/submit.yml",
    }
    of_the_engine = {
        str(path.relative_to(CHECKOUT))
        for path in (CHECKOUT / "paddock").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.suffix not in (".pyc", ".so")
    }
    assert of_the_engine <= inside
    assert made[".whl"].stat().st_size < 2_000_000


def test_it_asks_for_what_the_site_has_and_for_less():
    ours, sites = project("distribution/pyproject.toml"), project("pyproject.toml")
    assert ours["version"] == sites["version"] and ours["requires-python"] == sites["requires-python"]
    assert set(ours["dependencies"]) < set(sites["dependencies"])


def test_an_install_alone_makes_the_environments_known(home):
    program = """if True:
    import json, sys, gymnasium
    early = sorted(name for name in sys.modules if name.startswith(("paddock.simulator", "pybullet")))
    env = gymnasium.make("Paddock/TimeTrial-v1", track="oval")
    seen, _ = env.reset(seed=1)
    for _ in range(3): seen, *_ = env.step(env.action_space.sample())
    cars = gymnasium.make_vec("Paddock/ObjectAvoidance-v1", num_envs=2, track="oval")
    from importlib import metadata
    for one in metadata.entry_points(group="gymnasium.envs"): one.load()()  # as Gymnasium before 1.0: changes nothing
    from paddock.simulator import compiled
    import paddock
    print(json.dumps([early, list(seen["FRONT_FACING_CAMERA"].shape), paddock.__file__, compiled.load() is not None]))
    """
    done = run(home, "-c", program)
    assert done.returncode == 0, done.stderr
    early, shape, where, compiled = json.loads(done.stdout.strip().split("\n")[-1])
    assert early == [], "importing Gymnasium loads no simulator"
    assert shape == [120, 160, 1] and where.startswith(str(home))
    assert compiled == bool(list((CHECKOUT / "paddock/simulator").glob("*.so")))


def test_the_module_names_of_the_original_run_there(home, tmp_path):
    (wheel,) = (path for path in build(tmp_path, "paddock_deepracer") if path.suffix == ".whl")
    packages = tmp_path / "packages"
    zipfile.ZipFile(wheel).extractall(packages)
    program = f"""if True:
    import sys; sys.path.append({str(packages)!r})
    import gymnasium as gym
    env = gym.make("deepracer_gym:deepracer-v0", port=8888)
    seen, info = env.reset(seed=1)
    import deepracer
    print(seen["STEREO_CAMERAS"].shape, len(deepracer.running()), "torch" in sys.modules)
    """
    done = run(home, "-c", program)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().split("\n")[-1] == "(2, 120, 160) 1 False"


def test_nothing_of_the_site_is_there(home):
    program = f"import importlib.util as u; print([n for n in {SITES_OWN!r} if u.find_spec(n)])"
    assert run(home, "-c", program).stdout.strip().split("\n")[-1] == "[]"


def test_every_module_of_the_engine_can_be_imported_there(home):
    program = """if True:
    import importlib, pkgutil, paddock
    for one in pkgutil.walk_packages(paddock.__path__, "paddock."):
        name = one.name.split(".")[-1]  # "native-…" is the library in C
        if name.isidentifier() and name not in ("sb3", "__main__"): importlib.import_module(one.name)
    """
    done = run(home, "-c", program)
    assert done.returncode == 0, done.stderr


def test_the_command_drives_there(home):
    cars = CHECKOUT / "training/house_cars"
    done = subprocess.run(
        [str(home / "bin" / "paddock"), "evaluate", str(cars / "flyer.onnx"), str(cars / "flyer.json"),
         "--track", "oval", "--rule", "max_simulated_ms=2000", "--json"],
        capture_output=True, text=True, cwd=home, env={"PATH": os.environ["PATH"], "PADDOCK_CONFIG": str(home)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["simulated_ms"] == 2000
    version = project("distribution/pyproject.toml")["version"]
    assert f"paddock-racing {version}" in run(home, "-m", "paddock.cli", "--version").stdout


def test_a_starter_project_is_complete_there(home, tmp_path):
    done = run(home, "-m", "paddock.cli", "new", str(tmp_path / "car"))
    assert done.returncode == 0, done.stderr
    example = (CHECKOUT / "training/examples/train_a_car.py").read_text()
    assert (tmp_path / "car" / "train_a_car.py").read_text() == example

"""The example and the notebook for people who train elsewhere run as they are, and the site takes what they make."""

from __future__ import annotations

import importlib.util
import io
import json
import re
import subprocess
import sys
import zipfile
from contextlib import redirect_stdout
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from django.core.management import call_command

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")
pytestmark = pytest.mark.slow

CHECKOUT = Path(__file__).resolve().parents[2]
EXAMPLES = CHECKOUT / "training" / "examples"
NOTEBOOK = EXAMPLES / "train_a_car.ipynb"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    """The example as a module, found by its path as whoever copies it has it."""
    spec = importlib.util.spec_from_file_location("train_a_car", EXAMPLES / "train_a_car.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, str]:
    """The package that the example makes in two updates, and what it printed, run from the checkout as it says."""
    package = tmp_path_factory.mktemp("example") / "car.zip"
    ran = subprocess.run(
        [sys.executable, "training/examples/train_a_car.py", "--steps", "4000", "--seed", "3", "--out", str(package)],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert ran.returncode == 0, ran.stderr
    return package, ran.stdout


def evaluated(package: Path, *options: str) -> dict:
    """What ``manage.py evaluate --json`` says of a package on the oval."""
    printed = io.StringIO()
    with redirect_stdout(printed):
        call_command("evaluate", str(package), "--track", "oval", "--json", *options)
    return json.loads(printed.getvalue())


@pytest.mark.soak  # the notebook, below, does all that the example does
def test_the_example_prints_its_progress_and_what_it_packed(made):
    package, said = made
    assert "2000 steps" in said
    assert said.rstrip().endswith(f"packed: {package}")


@pytest.mark.soak
def test_the_site_drives_the_package_as_the_example_did(made, example):
    package, _ = made
    own = example.drive(package, laps=1, track="oval")["laps"]
    site = evaluated(package, "--laps", "1", "--max-resets", "20", "--time-limit", "180")["metrics"]
    assert [lap["elapsed_time_in_milliseconds"] for lap in site] == [lap["time_ms"] for lap in own]


def test_the_exported_network_scores_as_the_trained_policy(example, tmp_path):
    """The exported network scores a frame as the policy scores the pooled one, but for the rounding of the pooling."""
    import onnxruntime
    import torch

    cars = example.Cars(2, 1, track="oval", metadata=example.METADATA, start="random")
    model = example.train(cars, 1, 1, report=lambda line: None)
    frames = cars.env.reset(seed=5)[0].copy()
    cars.close()
    example.export(model, tmp_path / "car.zip")
    with zipfile.ZipFile(tmp_path / "car.zip") as archive:
        network = onnxruntime.InferenceSession(archive.read("model.onnx"))
    with torch.no_grad():
        seen, _ = model.policy.obs_to_tensor(example.pooled(frames))
        learned = model.policy.get_distribution(seen).distribution.logits.numpy()
    for frame, scores in zip(frames, learned, strict=True):
        (raced,) = network.run(None, {example.CAMERA: frame.transpose(2, 0, 1)[None].astype(np.float32)})
        np.testing.assert_allclose(raced[0] - raced[0].mean(), scores - scores.mean(), atol=0.05)


def test_the_last_step_of_an_episode_keeps_picture_and_reward(example):
    cars = example.Cars(2, 1, track="oval", metadata=example.METADATA, start="random", max_simulated_ms=1000)
    cars.reset()
    for _ in range(15):
        picture, rewards, done, infos = cars.step(np.array([2, 2]))
    assert done.all()
    assert [info["TimeLimit.truncated"] for info in infos] == [True, True]
    assert all((info["terminal_observation"] != now).any() for info, now in zip(infos, picture, strict=True))
    assert len(cars.episodes) == 2
    assert all(reward > rewards.max() and 0 < progress < 20 for reward, progress in cars.episodes)
    cars.close()


def test_the_example_trains_with_the_reward_function_it_shows(example):
    cars = example.Cars(1, 1, track="oval", metadata=example.METADATA, reward_function=lambda params: 7.0)
    cars.reset()
    assert cars.step(np.array([2]))[1].tolist() == [7.0]
    cars.close()


@pytest.fixture(scope="module")
def notebook() -> dict:
    """The notebook's JSON."""
    return json.loads(NOTEBOOK.read_text())


def test_the_notebook_runs_and_makes_a_package(notebook, tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(EXAMPLES))
    names: dict = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"]).replace("STEPS = 150_000", "STEPS = 2_000")
            exec(compile(source, NOTEBOOK.name, "exec"), names)
    assert names["STEPS"] == 2_000
    assert evaluated(tmp_path / "car.zip", "--laps", "1", "--time-limit", "30")["complete_laps"] in (0, 1)


def test_the_saved_notebook_ran_in_order_and_names_no_machine(notebook):
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert any("image/png" in output.get("data", {}) for cell in code for output in cell["outputs"])
    assert not any(output["output_type"] == "error" for cell in code for output in cell["outputs"])
    text = NOTEBOOK.read_text()
    assert len(text) < 200_000
    assert ".venv" not in text and not re.search(r"""["' ](/[a-z]+){2}""", text), "no path of a machine"

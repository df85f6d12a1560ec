"""TensorFlow itself, and the TFLite that it makes, answer exported graphs as the runtime does. Installs TensorFlow."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from paddock.packages.kinds import CAR

from .test_export import KINDS, TRAINED, car, feeds_of, runtimes, written

pytestmark = pytest.mark.soak
SCRIPT = Path(__file__).with_name("run_tensorflow.py")


@pytest.fixture(scope="module")
def tensorflow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with TensorFlow, which no other test may see: 270 MB to fetch."""
    folder = tmp_path_factory.mktemp("tensorflow")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--target", str(folder), "tensorflow-cpu"]
    done = subprocess.run(install, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"tensorflow-cpu cannot be installed here: {done.stderr.strip()[-300:]}")
    return folder


@pytest.mark.parametrize("kind", ["shallow, discrete", *KINDS, *TRAINED])
def test_tensorflow_and_tflite_answer_as_the_runtime_does(kind: str, tensorflow: Path, tmp_path: Path) -> None:
    canonical, metadata = car(kind)
    feed = feeds_of(metadata)[0]
    np.savez(tmp_path / "feeds.npz", **{name: one.astype(np.float32) for name, one in feed.items()})
    files = [
        str(written(canonical, metadata, CAR, tmp_path)),
        *(str(tmp_path / name) for name in ("feeds.npz", "out.npz")),
    ]
    environment = {**os.environ, "PYTHONPATH": str(tensorflow)}
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *files], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    expected = runtimes(canonical, metadata, feed)
    with np.load(tmp_path / "out.npz") as answers:
        for name in ("tensorflow", "tflite"):
            found = np.tanh(answers[name]) if metadata.algorithm == "sac" else answers[name]
            np.testing.assert_allclose(found, expected, atol=1e-5, rtol=0, err_msg=name)

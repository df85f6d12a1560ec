"""Torch is imported without what only its compiler needs, and says so where that would be another torch's."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.shared import CHECKOUT

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = pytest.mark.xdist_group("training")

CODE = """
import sys
from training.trainer import torch_imports
import torch
left = [name for name in ("torch._decomp", "torch._refs", "torch._prims") if name in sys.modules]
layer = torch.nn.Conv2d(1, 4, 3)
optimiser = torch.optim.Adam(layer.parameters())
layer(torch.ones(2, 1, 8, 8)).square().mean().backward()
optimiser.step()
print(left, torch_imports.version_of_torch() == torch.__version__, torch_imports.leave_meta_out())
"""


def test_torch_learns_without_what_its_compiler_needs():
    done = subprocess.run([sys.executable, "-c", CODE], cwd=CHECKOUT, capture_output=True, text=True, timeout=120)
    assert (done.stdout.strip(), done.returncode) == ("[] True False", 0), done.stderr

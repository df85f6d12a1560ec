"""The site's own processes stay light: what trains is imported by the trainer's process alone."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.evaluation.processes import environment
from tests.shared import CHECKOUT

HEAVY = ("torch", "stable_baselines3", "pybullet", "gymnasium", "scipy", "shapely", "onnxruntime", "optuna")
CODE = f"""
import sys, django
django.setup()
from django.urls import get_resolver
get_resolver().url_patterns
import training.jobs.services.queue, training.jobs.services.worker, training.tasks
print([name for name in {HEAVY} if name in sys.modules])
"""


@pytest.mark.slow
def test_the_site_imports_nothing_used_only_in_training(db):
    env = environment("redis://127.0.0.1:1/0")
    done = subprocess.run([sys.executable, "-c", CODE], cwd=CHECKOUT, env=env, capture_output=True, text=True)
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr

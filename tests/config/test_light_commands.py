"""Commands and the reading of uploads load no library that they do not use."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.evaluation.processes import environment
from tests.shared import CHECKOUT

HEAVY = (
    *("celery", "kombu", "redis", "rest_framework.serializers", "psycopg", "requests", "PIL", "av", "cv2", "pybullet"),
    *("onnx", "onnxruntime", "scipy", "shapely", "openskill", "segno", "fpdf", "icalendar", "markdown_it", "botocore"),
)
CODE = f"""
import sys, django
django.setup()
import races.management.commands.evaluate
print([name for name in {HEAVY} if name in sys.modules])
"""


def test_the_evaluate_command_loads_no_library_that_it_does_not_use():
    env = environment("redis://127.0.0.1:1/0")
    done = subprocess.run([sys.executable, "-c", CODE], cwd=CHECKOUT, env=env, capture_output=True, text=True)
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr


def test_a_wake_up_loads_the_sites_celery_app():
    """Also in a thread that has no current app of Celery."""
    code = """
import sys, threading, django
django.setup()
from core.wakeups import workers
assert "celery" not in sys.modules
thread = threading.Thread(target=lambda: print(workers._app().main, workers._app().conf.task_default_queue))
thread.start(); thread.join()
"""
    env = environment("redis://127.0.0.1:1/0")
    done = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, env=env, capture_output=True, text=True)
    assert (done.stdout.strip(), done.returncode) == ("paddock celery", 0), done.stderr


@pytest.mark.parametrize(
    ("module", "unused"),
    [
        ("paddock.cli.main", {"http.client", "importlib.metadata", "numpy", "urllib.request"}),
        ("evaluation.garage.conversion_process", {"http.client", "urllib.request", "xml.sax"}),
    ],
)
def test_a_process_loads_no_module_of_another_task(module, unused):
    code = f"import sys, {module}; print(sorted({unused} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True)
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr

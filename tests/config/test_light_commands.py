"""Commands and the reading of uploads load no library that they do not use."""

from __future__ import annotations

import subprocess
import sys

import pytest

from core.management.base import REFUSED
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


@pytest.mark.parametrize(
    ("arguments", "status", "unused"),
    [
        (["version"], 0, {"core", "django.conf", "django.core.management"}),
        (
            ["evaluate", "nowhere.onnx", "--track", "oval"],
            REFUSED,
            {*HEAVY, "django.core.mail", "django.db.models", "django.http", "django.views", "races.models"},
        ),
    ],
)
def test_a_command_without_the_database_loads_no_app(arguments, status, unused, tmp_path):
    code = f"""
import sys, manage
sys.argv = ["manage.py", *{arguments}]
try:
    manage.main()
    status = 0
except SystemExit as end:
    status = end.code
print(status, sorted({unused} & sys.modules.keys()))
"""
    env = environment("redis://127.0.0.1:1/0") | {"PADDOCK_DATA": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, env=env, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1:] == [f"{status} []"], done.stderr


def test_evaluate_loads_the_apps_for_a_track_of_the_database(tmp_path):
    """It finds the database without tables: a refusal, not a fault of the apps that were not loaded before."""
    database = tmp_path / "paddock.sqlite3"
    database.touch()
    command = [sys.executable, "manage.py", "evaluate", "nowhere.onnx", "--track", "back-yard"]
    env = environment("redis://127.0.0.1:1/0") | {"DATABASE_URL": f"sqlite:///{database}"}
    done = subprocess.run(command, cwd=CHECKOUT, env=env, capture_output=True, text=True)
    assert "track_database" in done.stderr and done.returncode == REFUSED, done.stderr


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
        ("paddock.cli.main", {"dataclasses", "hashlib", "importlib.metadata", "platform", "tempfile"}),
        ("paddock.cli.rehearsing", {"difflib", "http.client", "numpy", "platform", "urllib.request"}),
        ("paddock.simulator.race", {"numpy.random", "subprocess", "tempfile"}),
        ("paddock.packages.own", {"google.protobuf", "importlib.metadata", "onnx"}),
        ("evaluation.garage.conversion_process", {"http.client", "onnx", "paddock.packages.tensorflow", "xml.sax"}),
    ],
)
def test_a_process_loads_no_module_of_another_task(module, unused):
    code = f"import sys, {module}; print(sorted({unused} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, capture_output=True, text=True)
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr

"""The trainer's process reports an error of any class."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.shared import CHECKOUT

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = pytest.mark.xdist_group("training")

CODE = """
import os
import sys
from evaluation.sandbox.frames import read_message, write_message
from paddock.errors import PaddockError
from training.trainer import process

class Odd(Exception):
    __class__ = property(lambda self: PaddockError)

def fails(*_):
    raise Odd("of a racer")

process.make_ready, process.TrainerSpec, process.Training = (lambda: None), (lambda: None), fails
(question, ask), (answers, answer) = os.pipe(), os.pipe()
write_message(ask, {"spec": {}})
process.main(question, answer)
print([read_message(answers)[0] for _ in range(2)][1], file=sys.stderr)
"""


def test_a_class_that_lies_about_itself_is_an_error_like_any_other():
    done = subprocess.run([sys.executable, "-c", CODE], cwd=CHECKOUT, capture_output=True, text=True, timeout=120)
    last = done.stderr.splitlines()[-1]
    assert last == "{'error': {'code': 'trainer_error', 'params': {'detail': 'Odd: of a racer'}}}", done.stderr

"""Modules of the standard library in a reward function: no way round the list, no clock of the host, prints that come
back."""

from __future__ import annotations

import pytest

from training.rewards.validation import check_reward


def in_body(imports: str, body: str) -> str:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    return f"{imports}\n\n\ndef reward_function(params):\n{lines}\n"


def codes_of(text: str) -> list[tuple[str, object]]:
    return [(problem.code, problem.line) for problem in check_reward(text).problems]


@pytest.mark.parametrize(
    ("imports", "body"),
    [
        ("import logging", "return float(logging.os.getpid())"),
        ("import logging as log", "return float(log.threading.active_count())"),
        ("import json", "return float(json.codecs.builtins is None)"),
        ("import random", "return float(random._os.getpid())"),
        ("import logging", "logging.FileHandler('x')\nreturn 1.0"),
        ("import contextlib", "with contextlib.chdir('/'):\n    return 1.0"),
        ("import collections", "return float(len(collections._sys.modules))"),
    ],
)
def test_no_module_is_reached_through_another_one(imports, body):
    assert codes_of(in_body(imports, body)) == [("reward_forbidden_name", 5)]


@pytest.mark.parametrize(
    "line",
    [
        "from logging import os",
        "from logging import handlers",
        "from logging import config as anything",
        "from json import tool",
        "from warnings import sys",
        "from logging.handlers import SocketHandler",
    ],
)
def test_no_module_is_imported_out_of_another_one(line):
    codes = codes_of(in_body(line, "return 1.0"))
    assert [at for _code, at in codes] == [1]
    assert codes[0][0] in ("reward_forbidden_name", "reward_import_not_allowed")


def test_parts_of_what_is_allowed_stay_allowed():
    imports = """
import collections.abc
import json.decoder
import numpy as np
import scipy.spatial
from collections import abc
from json import decoder, encoder
from numpy import linalg, random
"""
    body = """
first = isinstance(params, collections.abc.Mapping) and issubclass(dict, abc.Mapping)
second = np.linalg.norm([0.0, 1.0]) + linalg.norm([0.0, 0.0]) + 0 * np.random.rand() + 0 * random.rand()
third = scipy.spatial.distance.euclidean((0, 0), (0, 1)) + (json.decoder is decoder) * (encoder is not None)
return float(first + second + third)
"""
    report = check_reward(in_body(imports, body))
    assert report.problems == []
    assert set(report.rewards.values()) == {4.0}


@pytest.mark.parametrize(
    ("imports", "body"),
    [
        ("import logging", "return logging.makeLogRecord({}).created - params['sim_time']"),
        ("import logging", "return logging.time.time() - params['sim_time']"),
        ("import calendar", "return float(calendar.datetime.date.today().year - 1970)"),
    ],
)
def test_the_librarys_own_modules_read_the_simulated_clock(imports, body):
    report = check_reward(in_body(imports, body))
    assert report.problems == []
    assert set(report.rewards.values()) == {0.0}


def test_dates_and_moments_are_instances_as_python_has_them():
    body = """
now = datetime.datetime.now()
kinds = [isinstance(now, datetime.date), isinstance(now.date(), datetime.date), isinstance(now, datetime.datetime)]
kinds += [issubclass(datetime.datetime, datetime.date), not isinstance(now.date(), datetime.datetime)]
kinds += [not isinstance(1, datetime.date), isinstance(min(calendar.Calendar().itermonthdates(2020, 1)), datetime.date)]
return float(all(kinds))
"""
    report = check_reward(in_body("import calendar\nimport datetime", body))
    assert report.problems == []
    assert set(report.rewards.values()) == {1.0}


@pytest.mark.parametrize(
    ("imports", "body", "printed"),
    [
        ("import traceback", "try:\n    1 / 0\nexcept ArithmeticError:\n    traceback.print_exc()", "division by zero"),
        ("import logging", "logging.warning('%d', 'much')", "Logging error"),
        ("import numpy", "numpy.log(numpy.zeros(1))", "divide by zero encountered in log"),
        ("import logging", "logging.warning('far out')", "far out"),
        ("import warnings", "warnings.warn('far out')", "UserWarning: far out"),
    ],
)
def test_what_the_library_writes_to_stderr_counts_as_printed(imports, body, printed):
    report = check_reward(in_body(imports, f"{body}\nreturn 1.0"))
    assert report.problems == []
    assert printed in report.printed


def test_tracebacks_without_end_are_prints_without_end():
    body = "while True:\n    try:\n        1 / 0\n    except ZeroDivisionError:\n        traceback.print_exc()"
    (problem,) = check_reward(in_body("import traceback", body)).problems
    assert (problem.code, problem.line) == ("reward_prints_too_much", 9)

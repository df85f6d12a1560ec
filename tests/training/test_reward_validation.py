"""Validation: a reward function is tried in the sandbox, in five states, and its problems come back."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from threading import Thread
from time import sleep

import pytest

from evaluation.sandbox.limits import REWARD
from evaluation.sandbox.probe import probe
from evaluation.sandbox.start import LEVEL_NAMESPACES
from paddock.errors import PlatformFault
from paddock.rules.race import RACE_TYPES
from training.rewards.sandbox import allowed_modules as modules
from training.rewards.sandbox import client as ask
from training.rewards.sandbox.function import from_wire, to_wire
from training.rewards.trial_states import STATES, five_states
from training.rewards.validation import Problem, check_reward


def validate_reward(code, **options):
    return check_reward(code, **options).problems


GOOD = "def reward_function(params):\n    return params['progress'] + 1"


@pytest.fixture(params=[2, 3], ids=["lock", "namespaces"])
def level(request):
    if probe().level < request.param:
        pytest.skip(f"this host offers sandbox level {probe().level} only")
    return request.param


def test_a_good_function_has_a_reward_in_every_state(level):
    report = check_reward(GOOD, level=level)
    assert report.problems == []
    assert report.rewards == {name: params["progress"] + 1 for name, params in zip(STATES, five_states(), strict=True)}
    assert validate_reward(GOOD, level=level) == []


ORDINARY = {
    "Korean names": "def reward_function(params):\n    보상 = 1.5\n    return 보상\n",
    "a letter by its name": "def reward_function(params):\n    return len('\\N{EM DASH}') + 0.5\n",
    "full-width letters": "def reward_function(params):\n    \uff41 = 1.5\n    return a\n",
    "a warning of the compiler": "def reward_function(params):\n    return 1.5 if params is not 1 else '\\d'\n",
    "a warning of numpy": (
        "import numpy\n\n\ndef reward_function(params):\n"
        "    numpy.array([1.0]) / numpy.array([0.0])\n    numpy.log(numpy.zeros(2))\n    return 1.5\n"
    ),
    "numbers in a text": (
        "def reward_function(params):\n    print(f'{1234.5:n} {1e9:,} {0.5:%}', flush=True)\n    return 1.5\n"
    ),
    "imports inside, self before": (
        "def reward_function(self, params):\n    import math\n    from scipy.spatial import distance\n"
        "    self.steps = 1 + getattr(self, 'steps', 0)\n    return math.sqrt(distance.euclidean((0, 0), (0, 2.25)))\n"
    ),
    "a long number as text": "def reward_function(params):\n    str(10**4000)\n    return 1.5\n",
    "a set of everything": "def reward_function(params):\n    repr(params) + str(vars())\n    return 1.5\n",
}


@pytest.mark.parametrize("text", ORDINARY.values(), ids=ORDINARY)
def test_ordinary_python_works_in_the_sandbox(level, text):
    report = check_reward(text, level=level)
    assert report.problems == []
    assert set(report.rewards.values()) == {1.5}


def test_the_libraries_work_in_the_sandbox(level):
    text = """
import math
import random
import numpy as np
from scipy.interpolate import splev, splprep
from scipy.spatial import KDTree
from shapely.geometry import Point, Polygon


def reward_function(params):
    points = np.array(params["waypoints"])
    spline, _ = splprep(points[:-1].T, s=0.1, per=True)
    x, y = splev(0.5, spline)
    tree = KDTree(points)
    apart, _ = tree.query((params["x"], params["y"]))
    inside = Polygon(params["waypoints"]).contains(Point(params["x"], params["y"]))
    return float(apart + math.hypot(x, y) + random.random() + inside + np.linalg.norm(points[0]))
"""
    report = check_reward(text, level=level)
    assert report.problems == []
    assert set(report.rewards) == set(STATES)


def test_rewards_are_repeatable():
    text = "def reward_function(params):\n    return len({str(key): 1 for key in params}) + hash('x') % 97"
    assert check_reward(text).rewards == check_reward(text).rewards


def test_prints_come_back():
    report = check_reward(
        "def reward_function(params):\n    print('step', params['steps'], '\\x1b[2J')\n    return 1.0"
    )
    assert report.printed.splitlines()[0] == f"step {five_states()[0]['steps']} ?[2J"


def test_a_problem_names_its_state_and_others_have_rewards():
    report = check_reward("def reward_function(params):\n    return 1 / (not params['is_offtrack'])")
    (problem,) = report.problems
    assert (problem.kind, problem.code, problem.line, problem.state) == ("test", "reward_raised", 2, "off_track")
    assert str(problem.fault).startswith("Line 2 of the reward function failed: ZeroDivisionError: division by zero (")
    assert set(report.rewards) == set(STATES) - {"off_track"}


def test_a_problem_common_to_all_states_is_listed_once():
    assert len(validate_reward("def reward_function(params):\n    return params['?']")) == 1


def test_different_problems_of_states_are_all_listed():
    text = "def reward_function(params):\n    if params['is_offtrack']:\n        return None\n    return params['?']"
    assert [(problem.code, problem.line) for problem in validate_reward(text)] == [
        ("reward_raised", 4),
        ("reward_not_a_number", 3),
    ]


def test_problem_kinds_are_those_of_the_console():
    text = "import os\n\ndef reward_function(params):\n    return y"
    assert [(problem.kind, problem.line) for problem in validate_reward(text)] == [("import", 1), ("syntax", 4)]


@pytest.mark.parametrize("race_type", RACE_TYPES)
def test_the_states_fit_the_race_type(race_type):
    text = "def reward_function(params):\n    return params['objects_distance'][params['closest_objects'][1]]"
    codes = [problem.code for problem in validate_reward(text, race_type=race_type)]
    assert codes == (["reward_raised"] if race_type == "time_trial" else [])


def test_params_enter_the_sandbox_with_values_and_types_intact():
    import json

    for race_type in RACE_TYPES:
        states = five_states(race_type)
        again = from_wire(json.loads(json.dumps(to_wire(states))))
        assert again == list(states)
        for before, after in zip(states, again, strict=True):
            assert [type(value) for value in before.values()] == [type(before[key]) for key in before]
            assert all(type(place) is tuple for place in (*after["waypoints"], *after["objects_location"]))


# --- when it is not the function's fault


def test_a_process_that_does_not_start_is_our_fault(monkeypatch):
    monkeypatch.setattr(ask, "MODULE", "training.rewards.nothing")
    with pytest.raises(PlatformFault) as fault:
        validate_reward(GOOD)
    assert fault.value.code == "reward_check_failed"


def test_a_host_that_is_too_busy_to_start_is_our_fault(monkeypatch):
    monkeypatch.setattr(ask, "REWARD", replace(REWARD, wall_s=0.001))
    with pytest.raises(PlatformFault) as fault:
        validate_reward(GOOD)
    assert fault.value.code == "reward_check_failed"


def test_a_function_that_hardly_got_the_cpu_is_not_blamed(monkeypatch):
    """A tenth of a second of wall time is over while it computes: that is no 5 s of computing."""
    launch = ask.launch

    def impatient(*args, **options):
        process = launch(*args, **options)
        monkeypatch.setattr(process, "allow", lambda _: type(process).allow(process, 0.3))
        return process

    monkeypatch.setattr(ask, "launch", impatient)
    with pytest.raises(PlatformFault) as fault:
        validate_reward("def reward_function(params):\n    while True:\n        pass")
    assert fault.value.code == "reward_check_failed"


def test_validations_at_once_are_limited_per_machine(monkeypatch):
    """Endless functions hold two slots and two seats to wait on, not the whole site."""
    monkeypatch.setattr(ask, "_SLOT_WAIT_S", 0.05)
    with ExitStack() as others:
        for _ in range(ask.SLOTS):
            others.enter_context(ask._slot())
        with pytest.raises(PlatformFault) as fault:
            validate_reward(GOOD)
        assert fault.value.code == "reward_check_busy"
    assert validate_reward(GOOD) == []


def test_nothing_runs_below_the_minimum_sandbox(monkeypatch):
    with pytest.raises(PlatformFault) as fault:
        validate_reward(GOOD, level=1)
    assert fault.value.code == "sandbox_unavailable"


@pytest.mark.parametrize(
    "answer",
    [
        {},
        {"faults": [], "rewards": [], "printed": 1},
        {"faults": [], "rewards": [1.0, 1.0], "printed": ""},
        {"faults": [], "rewards": [True], "printed": ""},
        {"faults": [], "rewards": ["1"], "printed": ""},
        {"faults": [], "rewards": [], "printed": "x" * 20_000},
        {"faults": [{}] * 65, "rewards": [], "printed": ""},
        {"faults": [{"code": "not_finite", "params": {}}], "rewards": [], "printed": ""},
        {"faults": [{"code": "reward_raised", "params": {"line": 1.5}}], "rewards": [], "printed": ""},
        {"faults": [{"code": "reward_raised", "params": {"line": -1}}], "rewards": [], "printed": ""},
        {"faults": [{"code": "reward_raised", "params": {}, "state": 7}], "rewards": [], "printed": ""},
        {"faults": [], "rewards": [float("nan")], "printed": ""},
        {"faults": [], "rewards": [100001.0], "printed": ""},
        {"faults": [{"code": "reward_raised", "params": {"code": "x"}}], "rewards": [], "printed": ""},
        {"faults": [{"code": ["reward_raised"], "params": {}}], "rewards": [], "printed": ""},
    ],
)
def test_a_malformed_answer_is_not_believed(answer):
    with pytest.raises(ValueError):
        ask._checked(answer, 1)


def test_an_answers_text_is_made_printable():
    told = {"code": "reward_raised", "params": {"line": 1, "error": "\x1b[2J" + "x" * 1000}, "state": None}
    ((fault, _),) = ask._checked({"faults": [told], "rewards": [], "printed": "a\x07\nb"}, 1).faults
    assert str(Problem.of(fault).fault).isprintable()
    assert len(fault.params["error"]) <= 300


# --- the sandbox's limits


def follow_peak(pid: int, peaks: list[float]) -> None:
    """Note the greatest address space that a process has had, in MB, until it has ended."""
    try:
        while True:
            with open(f"/proc/{pid}/status") as lines:
                peaks.append(next(int(line.split()[1]) for line in lines if line.startswith("VmPeak:")) / 1024)
            sleep(0.001)
    except (OSError, StopIteration):  # gone, or not yet collected
        return


def test_all_allowed_libraries_fit_in_half_of_the_memory(monkeypatch):
    names = [f"{package}.{part}" for package, parts in modules._PARTS.items() for part in parts]
    text = "".join(f"import {name}\n" for name in names) + GOOD
    peaks: list[float] = []
    launch = ask.launch

    def watched(*args, **options):
        process = launch(*args, **options)
        while process.inner_pid is None and process.poll() is None:
            sleep(0.001)
        Thread(target=follow_peak, args=(process.inner_pid, peaks)).start()
        return process

    monkeypatch.setattr(ask, "launch", watched)
    assert validate_reward(text) == []
    assert max(peaks) < REWARD.address_space_mb / 2


def test_our_own_files_are_hidden_at_the_strongest_level():
    """Even before the lock there is nothing but code; after it not even that can be opened."""
    if probe().level < LEVEL_NAMESPACES:
        pytest.skip("no namespaces here")
    text = (
        "import random\nfound = getattr(random, '_os').sys.modules['os']\n"
        "def reward_function(params):\n    found.listdir('/')\n    return 1.0"
    )
    assert [(problem.code, problem.line) for problem in validate_reward(text)] == [("reward_raised", 4)]

"""What validation accepts, and what it warns about: the standard library, other forms of the function, the first step,
the percentage, and slow functions."""

from __future__ import annotations

import ast
import sys

import pytest

from paddock.errors import UserFault
from tests.shared import CHECKOUT
from training.rewards.laboratory.recorded_lap import rewards_along
from training.rewards.sandbox.allowed_modules import ALLOWED, STANDARD, is_allowed, preload, wanted_modules
from training.rewards.sandbox.function import load_reward
from training.rewards.sandbox.hints import CARS, SLOW_MS, UPDATE_STEPS, hints_of, slowness
from training.rewards.sandbox.static_checks import check_text
from training.rewards.trial_states import STATES, five_states
from training.rewards.validation import check_reward
from training.trainer.spec import CARS as GATHERING
from training.trainer.spec import TrainerSpec

PARAMS = five_states()[1]


def lines(text: str) -> list[tuple[str, int]]:
    return [(hint.code, hint.params["line"]) for hint in hints_of(text)]


# --- the standard library

USES = """
import array, base64, binascii, calendar, cmath, collections, colorsys, contextlib, copy, dataclasses, datetime, decimal
import difflib, enum, fractions, functools, graphlib, hashlib, heapq, itertools, json, logging, numbers, operator
import pprint, re, reprlib, statistics, string, struct, textwrap, time, traceback, typing, unicodedata, warnings
import weakref, zlib
from abc import ABC
from bisect import bisect
from collections.abc import Sequence
from datetime import datetime as moment
from time import perf_counter, sleep

logging.basicConfig(level=logging.INFO)
logger = logging.getLogger(__name__)


class Gear(enum.Enum):
    LOW = 1


@dataclasses.dataclass
class Place:
    x: float
    seen: typing.List[float] = dataclasses.field(default_factory=list)


def reward_function(params):
    place = copy.deepcopy(Place(params["x"]))
    logger.info("at %.1f", place.x)
    try:
        raise ValueError("tried")
    except ValueError:
        print(traceback.format_exc())
    warnings.warn("look out")
    sleep(1000)
    began = time.strptime("2024-01-01", "%Y-%m-%d").tm_year + moment.strptime("2024", "%Y").year
    statistics.mean([fractions.Fraction(1), fractions.Fraction(decimal.Decimal("3"))])
    json.loads(json.dumps({"at": bisect([1, 2], params["x"])}))
    pprint.pformat(place), textwrap.dedent(" x"), re.sub("a", "b", "abc"), struct.pack("f", 1.0), hashlib.sha256(b"x")
    return time.time() + perf_counter() + datetime.datetime.now().timestamp() * 0 + began * 0
"""


def test_modules_that_only_compute_work_in_the_sandbox():
    report = check_reward(USES)
    assert [str(problem.fault) for problem in report.problems] == []
    times = {name: params["sim_time"] for name, params in zip(STATES, five_states(), strict=True)}
    assert report.rewards == {name: pytest.approx(2 * seconds) for name, seconds in times.items()}
    assert "INFO:" in report.printed and "look out" in report.printed and "ValueError: tried" in report.printed


def test_every_allowed_module_of_the_standard_library_can_be_imported():
    names = "\n".join(f"import {name}" for name in STANDARD)
    assert check_reward(f"{names}\n\n\ndef reward_function(params):\n    return 1.0\n").problems == []


@pytest.mark.parametrize(
    "name",
    [
        *("os", "sys", "io", "pathlib", "subprocess", "socket", "threading", "multiprocessing", "ctypes", "importlib"),
        *("pickle", "shelve", "gc", "inspect", "signal", "tempfile", "shutil", "urllib.request", "http", "asyncio"),
        *("builtins", "code", "marshal", "mmap", "ssl", "sqlite3", "logging.handlers", "json.tool", "pandas", "torch"),
    ],
)
def test_what_gives_more_is_refused_with_the_reason(name):
    (fault,) = check_text(f"import {name}\ndef reward_function(params):\n    return 1.0")
    assert (fault.code, fault.params["line"], fault.params["name"]) == ("reward_import_not_allowed", 1, name)
    assert "files, processes, network" in str(fault)
    assert not is_allowed(name)


def test_all_allowed_names_are_pythons_or_the_fields():
    assert set(STANDARD) <= set(sys.stdlib_module_names)
    assert set(ALLOWED) - set(STANDARD) == {"math", "random", "numpy", "scipy", "shapely"}


def test_each_car_has_a_simulated_clock_and_nothing_else_sees_it():
    import time as real

    text = "import time as t, datetime\ndef reward_function(params):\n    return t.monotonic()\n"
    one, other = load_reward(text), load_reward(text)
    assert one({**PARAMS, "sim_time": 4.5}) == 4.5
    assert other({**PARAMS, "sim_time": 7.0}) == 7.0
    assert one({**PARAMS, "sim_time": 0.5}) == 0.5, "the next episode"
    assert real.time() > 1e9
    today = "from datetime import date\ndef reward_function(params):\n    return date.today().year"
    assert load_reward(today)(PARAMS) == 1970.0


def test_words_of_the_text_decide_what_is_loaded():
    assert wanted_modules("import bisect, time") == ["bisect", "time", "_strptime"]
    preload(["no_such_module"])


# --- other forms


@pytest.mark.parametrize(
    "text",
    [
        "\ufeffdef reward_function(params):\n    return 1.5",
        "import numpy as np\ndef reward_function(params):\n    return np.array([1.5])",
        "import numpy as np\ndef reward_function(params):\n    return np.array([[1.5]])",
        "def reward_function(params, x=1):\n    return 0.5 + x",
        "def reward_function(params, *, x=1):\n    return 0.5 + x",
        "def reward_function(params=None):\n    return 1.5 * bool(params)",
        "def reward_function(self, params, x=1):\n    return 0.5 + x",
        "class Car:\n    def pay(self, params):\n        return 1.5\ncar = Car()\nreward_function = car.pay",
        "class Car:\n    def __call__(self, params):\n        return 1.5\nreward_function = Car()",
        "class Car:\n    @staticmethod\n    def pay(params):\n        return 1.5\nreward_function = Car.pay",
        "from functools import partial\ndef pay(a, params):\n    return a\nreward_function = partial(pay, 1.5)",
        "reward_function = lambda params: 1.5",
        "def pay(params):\n    return 1.5\nreward_function: object = pay",
        "def twice(f):\n    return lambda params: 2 * f(params)\n@twice\ndef reward_function(params):\n    return 0.75",
        "def reward_function(params):\n    return 0.75\n\ndef twice(f):\n    return lambda params: 2 * f(params)\n"
        "reward_function = twice(reward_function)",
    ],
)
def test_usual_forms_of_a_reward_function_are_accepted(text):
    report = check_reward(text)
    assert [str(problem.fault) for problem in report.problems] == []
    assert set(report.rewards.values()) == {1.5} and len(report.rewards) == 5


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("import numpy as np\ndef reward_function(params):\n    return np.array([1.0, 2.0])", "reward_not_a_number"),
        ("import numpy as np\ndef reward_function(params):\n    return np.array([])", "reward_not_a_number"),
        ("def reward_function(params):\n    return [1.0]", "reward_not_a_number"),
        ("def reward_function(params, x):\n    return 1.0", "reward_arguments"),
        ("def reward_function(params, *, x):\n    return 1.0", "reward_arguments"),
        ("def reward_function():\n    return 1.0", "reward_arguments"),
        ("reward_function = 1", "reward_function_missing"),
        ("class Car:\n    pass\nreward_function = Car", "reward_function_missing"),
        ("def pay(a, b):\n    return 1.0\nreward_function = pay", "reward_arguments"),
        ("async def pay(params):\n    return 1.0\nreward_function = pay", "reward_function_kind"),
    ],
)
def test_other_forms_are_refused_with_their_reason(text, code):
    assert [problem.code for problem in check_reward(text).problems] == [code]


def test_a_failure_in_a_method_is_reported_at_its_line():
    text = "class Car:\n    def pay(self, params):\n        return None\nreward_function = Car().pay"
    with pytest.raises(UserFault) as fault:
        load_reward(text)(PARAMS)
    assert (fault.value.code, fault.value.params["line"]) == ("reward_not_a_number", 3)


# --- the first step, the percentage, the state that failed

KEEPS_ITS_START = """
class Keeper:
    def pay(self, params):
        if params["steps"] == 1:
            self.start = params["closest_waypoints"][0]
        return 1.0 + self.start


reward_function = Keeper().pay
"""


def test_validation_tries_steps_1_and_warns_that_training_has_none():
    report = check_reward(KEEPS_ITS_START)
    assert report.problems == [] and len(report.rewards) == 5
    (warning,) = report.warnings
    assert (warning.kind, warning.code, warning.line) == ("warning", "reward_first_step", 4)
    assert "“steps” is 2 in the first call" in str(warning.fault)
    assert five_states()[0]["steps"] == 2


@pytest.mark.parametrize(
    "comparison",
    [
        "params['steps'] == 1",
        "params['steps'] == 0",
        "1 == params['steps']",
        "params.get('steps') == 1",
        "params['steps'] <= 1",
        "params['steps'] < 2",
        "2 > params['steps']",
        "params['steps'] in (0, 1)",
        "int(params['steps']) == 1",
        "(steps := params['steps']) == 1",
    ],
)
def test_a_comparison_with_a_step_before_the_second_is_a_hint(comparison):
    assert lines(f"def reward_function(params):\n    return float({comparison})") == [("reward_first_step", 2)]


@pytest.mark.parametrize(
    "text",
    [
        "def reward_function(params):\n    steps = params['steps']\n    return 1.0 if steps == 1 else 0.0",
        "def reward_function(params):\n    n, p = params['steps'], params['progress']\n    return float(n == 0)",
        "def pay(steps):\n    return float(steps == 1)\ndef reward_function(params):\n    return pay(1)",
        "class Car:\n    def pay(self, params):\n        self.n = params['steps']; return float(self.n == 1)",
    ],
)
def test_variables_are_followed(text):
    assert [code for code, _ in lines(text)] == ["reward_first_step"]


@pytest.mark.parametrize(
    "comparison", ["params['progress'] == 1", "params['progress'] == 1.0", "1 == params['progress']"]
)
def test_progress_compared_with_one_is_a_hint(comparison):
    assert lines(f"def reward_function(params):\n    return float({comparison})") == [("reward_percent", 2)]


@pytest.mark.parametrize(
    "comparison",
    [
        "params['steps'] == 2",
        "params['steps'] > 0",
        "params['steps'] <= 2",
        "params['steps'] % 10 == 0",
        "params['steps'] in (0, 1, 2)",
        "params['progress'] == 100",
        "params['progress'] >= 1",
        "params['progress'] / 100 == 1",
        "params['speed'] == 1",
        "params['closest_waypoints'][0] == 1",
        "params['steps'] == limit",
    ],
)
def test_comparisons_that_can_hold_are_no_hints(comparison):
    text = f"limit = 1\ndef reward_function(params):\n    return float({comparison})"
    ast.parse(text)
    assert lines(text) == []


def test_a_failure_names_the_state():
    (problem,) = check_reward("def reward_function(params):\n    return 1 / (not params['is_offtrack'])").problems
    off = five_states()[STATES.index("off_track")]
    assert f"(off_track: steps {off['steps']}, progress {off['progress']:.1f})" in str(problem.fault)


# --- slow functions


def loop(count: int, before: str = "") -> str:
    return f"{before}def reward_function(params):\n    for _ in range({count}):\n        pass\n    return 1.0\n"


def test_a_slow_function_is_warned_about_with_its_milliseconds():
    report = check_reward(loop(1_000_000))
    assert report.problems == [] and len(report.rewards) == 5
    (warning,) = report.warnings
    assert (warning.kind, warning.code) == ("warning", "reward_slow")
    assert warning.params["ms"] >= SLOW_MS and str(warning.params["ms"]) in str(warning.fault)
    assert warning.params["seconds"] == pytest.approx(warning.params["ms"] * UPDATE_STEPS / 1000, abs=1.5)


def test_a_fast_function_is_not_warned_about():
    assert check_reward(loop(10)).warnings == []


def test_five_milliseconds_are_the_bound_and_one_slow_call_is_none():
    assert [warning.code for warning in slowness([5.0] * 6, 0.0)] == ["reward_slow"]
    assert slowness([4.9] * 6, 499.0) == []
    assert slowness([400.0, 0.1, 0.1], 0.0) == [], "what it prepares in its first call"
    assert [warning.code for warning in slowness([0.1], 500.0)] == ["reward_slow_start"]
    assert slowness([], 0.0) == []


def test_the_figures_of_the_warnings_are_those_of_a_training():
    spec = TrainerSpec({}, "time_trial", {}, "ppo", {"num_episodes_between_training": 20})
    assert spec.steps_each * GATHERING == pytest.approx(UPDATE_STEPS, rel=0.02)
    assert GATHERING + spec.trials_driven <= CARS <= GATHERING + spec.trials_driven + 1


def test_a_slow_start_is_warned_about():
    (warning,) = check_reward(loop(10, "for _ in range(40_000_000):\n    pass\n")).warnings
    assert warning.code == "reward_slow_start" and warning.params["count"] == CARS


@pytest.mark.slow
def test_the_laboratory_shows_what_there_was_time_for():
    """Many calls together take the time of one: that is no endless loop."""
    along = rewards_along(loop(20_000_000), [dict(PARAMS)] * 100)
    assert along.problems == []
    known = [reward for reward in along.rewards if reward is not None]
    assert 0 < len(known) < 100
    (warning,) = along.warnings
    assert warning.code == "reward_slow_in_all"
    assert (warning.params["count"], warning.params["total"]) == (len(known), 100)


# --- as given


def test_every_allowed_module_is_documented():
    page = (CHECKOUT / "docs" / "rewards.md").read_text()
    assert [name for name in ALLOWED if f"`{name}`" not in page] == []

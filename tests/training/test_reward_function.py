"""A reward function's text becomes a function of params, and every way to fail has a code and a line."""

from __future__ import annotations

import copy
import math
import random

import pytest

from paddock.errors import UserFault
from training.rewards.sandbox.allowed_modules import preload, wanted_modules
from training.rewards.sandbox.call_limits import (
    KEPT_CHARACTERS,
    LAST_CHARACTERS,
    LIMIT_S,
    TICK_S,
    TooLong,
    TooMuchPrinted,
    Watch,
    line_in,
    watch,
)
from training.rewards.sandbox.function import POSITIONAL_NAMES, load_reward, load_rewards, positional
from training.rewards.trial_states import five_states

PARAMS = five_states()[1]


def failing(text: str, params=PARAMS) -> tuple[str, dict]:
    with pytest.raises(UserFault) as fault:
        load_reward(text)(params)
    return fault.value.code, fault.value.params


def test_the_functions_number_comes_back_as_a_float():
    reward = load_reward("def reward_function(params):\n    return params['steps']")
    assert reward(PARAMS) == float(PARAMS["steps"])
    assert type(reward(PARAMS)) is float
    assert reward.form == "params"


@pytest.mark.parametrize("returned", ["True", "'1'", "1", "numpy.float32(1)", "numpy.array(1)"])
def test_anything_that_float_accepts_is_a_reward(returned):
    assert load_reward(f"import numpy\ndef reward_function(params):\n    return {returned}")(PARAMS) == 1.0


def test_changes_to_params_do_not_leave_the_function():
    before = copy.deepcopy(PARAMS)
    text = (
        "def reward_function(params):\n"
        "    for key, value in params.items():\n"
        "        if type(value) is list:\n"
        "            value.append(value)\n"
        "            value.reverse()\n"
        "    params.clear()\n"
        "    return 1"
    )
    assert load_reward(text)(PARAMS) == 1.0
    assert before == PARAMS


def test_params_hold_nothing_deeper_than_flat_lists():
    """The copy that is made is cheaper than deepcopy and must not be shallower."""
    for race_type in ("time_trial", "object_avoidance", "head_to_head"):
        for params in five_states(race_type):
            for value in params.values():
                parts = value if type(value) is list else [value]
                for part in parts:
                    assert copy.deepcopy(part) is part


def test_the_form_of_2018_gets_twelve_values_in_order():
    text = f"def reward_function({', '.join(POSITIONAL_NAMES)}):\n    return {{}}"
    params = {**PARAMS, "speed": 1.0, "steering_angle": -15.0, "heading": 90.0, "closest_waypoints": [3, 4]}
    params |= {"x": params["waypoints"][4][0], "y": params["waypoints"][4][1]}
    for name, value in {
        "on_track": 1.0,
        "x": params["x"],
        "y": params["y"],
        "distance_from_center": params["distance_from_center"],
        "car_orientation": math.pi / 2,
        "progress": params["progress"],
        "steps": params["steps"],
        "throttle": 0.25,
        "steering": -0.5,
        "track_width": params["track_width"],
        "waypoints[7][1]": params["waypoints"][7][1],
        "closest_waypoint": 4,
    }.items():
        reward = load_reward(text.format(name))
        assert reward.form == "positional"
        assert reward(params) == pytest.approx(value), name


def test_arguments_of_the_2018_form_may_have_any_names():
    text = "def reward_function(a, b, c, d, e, f, g, h, i, j, k, l):\n    return h"
    assert load_reward(text)(PARAMS) == positional(PARAMS)[7]


@pytest.mark.parametrize("form", [["params"], list(POSITIONAL_NAMES)])
def test_self_belongs_to_one_car_and_lasts_between_steps(form):
    body = "    self.steps = getattr(self, 'steps', 0) + 1\n    return self.steps"
    one, other = load_rewards(f"def reward_function(self, {', '.join(form)}):\n{body}", 2)
    assert [one(PARAMS), one(PARAMS), other(PARAMS)] == [1.0, 2.0, 1.0]


def test_the_2018_guides_printed_example_runs():
    """As the developer guide of that year prints it: ``self`` first, the import inside."""
    text = f"""def reward_function(self, {", ".join(POSITIONAL_NAMES)}):
    import math
    marker_1 = 0.1 * track_width
    reward = 1e-3
    if distance_from_center >= 0.0 and distance_from_center <= marker_1:
        reward = math.sqrt(1.0)
    return float(reward)
"""
    assert load_reward(text)({**PARAMS, "distance_from_center": 0.0}) == 1.0


def test_a_nose_beyond_the_border_is_off_track():
    params = {**PARAMS, "distance_from_center": PARAMS["track_width"] / 2 + 0.01}
    assert positional(params)[0] is False


@pytest.mark.parametrize(
    ("body", "code", "line"),
    [
        ("return None", "reward_not_a_number", 2),
        ("if params:\n        return float('nan')\n    return 1", "reward_not_finite", 3),
        ("return float('-inf')", "reward_not_finite", 2),
        ("return 100001", "reward_too_large", 2),
        ("return 1 / 0", "reward_raised", 2),
        ("def inner():\n        return params['?']\n    return inner()", "reward_raised", 3),
        ("pass", "reward_not_a_number", 2),
    ],
)
def test_a_failure_is_reported_with_its_line(body, code, line):
    found, params = failing(f"def reward_function(params):\n    {body}")
    assert (found, params["line"]) == (code, line)


def test_a_reward_at_the_bound_is_allowed():
    assert load_reward("def reward_function(params):\n    return -1e5")(PARAMS) == -1e5


def test_a_library_error_is_reported_at_the_calling_line():
    text = "import numpy\ndef reward_function(params):\n    return numpy.linalg.inv([[0.0]])[0, 0]"
    code, params = failing(text)
    assert (code, params["line"], params["error"]) == ("reward_raised", 3, "LinAlgError: Singular matrix")


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("return params['distance_from_centre']", {"name": "distance_from_centre", "meant": "distance_from_center"}),
        ("return params['Speed']", {"name": "Speed", "meant": "speed"}),
        ("return params['all_wheels_on_the_track']", {"meant": "all_wheels_on_track"}),
    ],
)
def test_a_misspelt_parameter_is_reported_with_the_right_one(body, told):
    code, params = failing(f"def reward_function(params):\n    {body}")
    assert code == "reward_param_unknown" and params["line"] == 2
    assert told.items() <= params.items()


@pytest.mark.parametrize("body", ["return params['?']", "return {}['speed']", "return {}[7]", "raise KeyError"])
def test_other_key_errors_are_reported_unchanged(body):
    code, params = failing(f"def reward_function(params):\n    {body}")
    assert code == "reward_raised" and params["error"].startswith("KeyError")


def test_a_failure_only_on_repeat_is_reported_at_the_definition():
    text = (
        "calls = []\ndef reward_function(params):\n    calls.append(1)\n"
        "    if len(calls) > 1:\n        raise ValueError\n    return float('nan')"
    )
    assert failing(text)[1]["line"] == 2


@pytest.mark.parametrize("text", ["x = 1", "reward_function = 1", "class reward_function:\n    pass"])
def test_a_text_without_the_function_is_refused(text):
    assert failing(text)[0] == "reward_function_missing"


def test_each_cars_function_has_its_own_memory():
    text = "steps = []\ndef reward_function(params):\n    steps.append(1)\n    return len(steps)"
    first, second = load_rewards(text, 2)
    assert [first(PARAMS), first(PARAMS), second(PARAMS)] == [1.0, 2.0, 1.0]


def test_random_numbers_come_from_the_seed_of_the_process():
    reward = load_reward("import random\ndef reward_function(params):\n    return random.random()")
    random.seed(7)
    first = reward(PARAMS)
    random.seed(7)
    assert reward(PARAMS) == first


# --- time and prints


def test_a_call_out_of_time_is_interrupted_even_if_it_catches():
    one = Watch()
    one.begin()
    for _ in range(round(LIMIT_S / TICK_S) - 1):
        one.tick(0, None)
    for _ in range(3):
        with pytest.raises(TooLong):
            one.tick(0, None)
    one.end()
    one.tick(0, None)


def test_prints_are_kept_to_a_limit_and_a_flood_ends_the_call():
    one = Watch()
    for _ in range(3):
        one.begin()
        one.write("x" * 30_000)
        one.end()
    assert one.printed == "x" * KEPT_CHARACTERS
    one.begin()
    with pytest.raises(TooMuchPrinted):
        one.write("x" * 64_001)
    one.end()
    assert one.write("x" * 10**6) == 10**6  # not a call: nobody's business


def said_by(watch: Watch, *texts: str) -> None:
    watch.begin()
    for text in texts:
        watch.write(text)
    watch.end()


def test_prints_are_reported_once_in_whole_lines():
    watch = Watch()
    assert watch.news() is None
    said_by(watch, "one", "\n", "tw")
    assert watch.news() == {"kept": "one\n", "last": "one\ntw", "more": False}
    assert watch.news() is None
    said_by(watch, "o\n")
    assert watch.news() == {"kept": "two\n", "last": "one\ntwo\n", "more": False}
    said_by(watch, "thr")
    assert watch.news()["kept"] == ""
    assert watch.news(over=True) == {"kept": "thr", "last": "one\ntwo\nthr", "more": False}
    assert watch.news(over=True) is None


def test_long_output_keeps_its_start_and_reports_its_newest():
    watch = Watch()
    for number in range(10_000):
        said_by(watch, f"line {number}\n")
    news = watch.news()
    assert len(news["kept"]) == KEPT_CHARACTERS and news["kept"].startswith("line 0\n") and news["more"]
    lines = news["last"].splitlines()
    assert lines[-1] == "line 9999" and len(news["last"]) <= LAST_CHARACTERS
    assert all(line.startswith("line 9") for line in lines), "no line without its beginning"
    said_by(watch, "the end\n")
    news = watch.news()
    assert (news["kept"], news["last"].splitlines()[-1]) == ("", "the end")


def test_top_level_prints_appear_once_for_many_cars(monkeypatch):
    watched = Watch()
    monkeypatch.setattr("training.rewards.sandbox.function.watch", watched)
    monkeypatch.setattr("sys.stdout", watched)
    one, two = load_rewards("print('loaded')\ndef reward_function(params):\n    print('called')\n    return 1", 2)
    assert (one(PARAMS), two(PARAMS)) == (1.0, 1.0)
    assert watched.printed == "loaded\ncalled\ncalled\n"


def test_an_endless_call_is_reported_at_its_line(monkeypatch):
    """The timer's signal is the trainer's and the validation's; here the function calls it itself."""
    monkeypatch.setattr(watch, "limit_s", TICK_S)
    monkeypatch.setattr("builtins.tick", lambda: watch.tick(0, None), raising=False)
    assert failing("def reward_function(params):\n    while True:\n        tick()") == ("reward_too_slow", {"line": 3})


def test_a_crash_is_placed_at_the_innermost_line_of_its_report():
    report = (
        'Fatal Python error: Segmentation fault\n\nCurrent thread 0x1 (most recent call first):\n  File "numpy.py", '
        'line 3 in f\n  File "<reward function>", line 12 in inner\n  File "<reward function>", line 20 in x\n'
    )
    assert line_in(report) == 12
    assert line_in(report + report.replace("line 12", "line 13")) == 13
    assert line_in("") is None
    assert line_in('File "<reward function>", line 99999999999 in x') is None


# --- modules


def test_wanted_modules_are_found_by_words_in_the_text():
    text = "import numpy as np\nfrom scipy.spatial import distance\nfrom shapely.geometry import Point"
    assert wanted_modules(text) == [
        "numpy",
        "scipy",
        "shapely",
        "scipy.spatial",
        "shapely.geometry",
        "scipy.spatial.distance",
    ]
    assert wanted_modules("import os, torch; numpyx; __import__('evil')") == []


def test_a_missing_module_is_left_to_its_import_to_report():
    preload(["scipy.nonsense", "nonsense"])

"""What is said about a reward function before it runs."""

from __future__ import annotations

import pytest

from training.rewards.sandbox.static_checks import MAX_CHARACTERS, check_text

GOOD = """from __future__ import annotations

import math
import random as dice
import numpy as np
from scipy.spatial import KDTree
from shapely.geometry import Polygon


class Track:
    def save(self, speed: float) -> None:
        self.speed = speed

    def load(self):
        return self.speed


def helper(params):
    return math.pi + dice.random() + np.mean([1, 2])


track = Track()


def reward_function(params):
    tree, road = KDTree(params["waypoints"]), Polygon(params["waypoints"])
    track.save(params["speed"])
    return float(helper(params) + track.load() + tree.query((0, 0))[0] + road.area)
"""


def found(text):
    return [(fault.code, fault.params.get("line")) for fault in check_text(text)]


def test_helpers_classes_and_libraries_are_allowed():
    assert found(GOOD) == []


def test_unused_imports_and_variables_are_allowed():
    assert found("import math\ndef reward_function(params):\n    unused = 1\n    return 1.0") == []


def test_a_top_level_import_may_stand_in_a_block():
    text = (
        "try:\n    import numpy as np\nexcept ImportError:\n    np = None\ndef reward_function(params):\n    return 1.0"
    )
    assert found(text) == []


def test_all_problems_are_listed_in_the_order_of_their_lines():
    text = "import os\nimport math\ndef reward_function(params, x):\n    import socket\n    return z + eval('1')\n"
    assert found(text) == [
        ("reward_import_not_allowed", 1),
        ("reward_arguments", 3),
        ("reward_import_not_allowed", 4),
        ("reward_forbidden_name", 5),
        ("reward_undefined_name", 5),
    ]


def test_at_most_twenty_problems_are_listed():
    text = "".join(f"import os{number}\n" for number in range(100)) + "def reward_function(params):\n    return 1.0"
    assert len(check_text(text)) == 20


@pytest.mark.parametrize("name", ["import scipy.io as x", "from . import x", "import numpyx", "from random_ import x"])
def test_only_the_five_allowed_libraries_can_be_imported(name):
    problems = found(f"{name}\ndef reward_function(params):\n    return 1.0")
    assert problems == ([] if "scipy" in name else [("reward_import_not_allowed", 1)])


def test_a_generator_inside_does_not_make_the_function_one():
    text = "def reward_function(params):\n    def each():\n        yield 1.0\n    return sum(each())"
    assert found(text) == []


def test_twelve_arguments_tell_the_form_of_2018():
    names = ", ".join("abcdefghijkl")
    assert found(f"def reward_function({names}):\n    return 1.0") == []
    assert found(f"def reward_function({names}, m):\n    return 1.0") == [("reward_arguments", 1)]
    assert found("def reward_function(params, *, more):\n    return 1.0") == [("reward_arguments", 1)]


def test_self_may_come_first_in_either_form():
    names = ", ".join("abcdefghijkl")
    assert found(f"def reward_function(self, {names}):\n    return 1.0") == []
    assert found("def reward_function(self, params):\n    return 1.0") == []
    assert found("def reward_function(self, /, params):\n    return 1.0") == []
    assert found("def reward_function(self):\n    return 1.0") == [], "one argument is params, whatever its name"
    assert found(f"def reward_function(it, {names}):\n    return 1.0") == [("reward_arguments", 1)]


def test_allowed_libraries_may_be_imported_inside_a_function():
    text = "def reward_function(params):\n    import math\n    from numpy import mean\n    return mean([math.pi])"
    assert found(text) == []


def test_string_formatting_mistakes_are_found_before_running():
    assert found("def reward_function(params):\n    print('%d %d' % (1,))\n    return 1.0") == [("reward_mistake", 2)]


def test_length_counts_characters():
    assert found("") == [("reward_length", None)]
    assert found("#" * (MAX_CHARACTERS + 1)) == [("reward_length", None)]
    assert found("#" * MAX_CHARACTERS) == [("reward_function_missing", None)]

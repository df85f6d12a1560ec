"""A race rule has one definition; few other files name it."""

import ast
import re
import subprocess
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

from paddock.rules.race import RULES, RUN_RULES

ROOT = Path(__file__).resolve().parents[2]
MOST = 6
# Words of the whole domain: tracks, runs, vehicles and boards have them too, so their files cannot be told apart.
WORDS = {
    *("race_type", "laps", "seed", "direction", "start_m", "boxes", "bots", "sensors", "opponents", "ranking_method"),
}
NAMES = sorted({*RULES, *RUN_RULES} - WORDS)


@cache
def product_files() -> list[str]:
    listed = subprocess.run(["git", "ls-files", "*.py"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [name for name in listed.split() if not re.search(r"^tests/|^benchmarks/|/migrations/", name)]


@cache
def files_by_name() -> dict[str, set[str]]:
    """For each rule the files that name it: as a text, a field of a class or a parameter. Reading a rule of a race or a
    run as an attribute is not naming it."""
    found = defaultdict(set)
    for name in product_files():
        for node in ast.walk(ast.parse((ROOT / name).read_text())):
            match node:
                case ast.Constant(value=str(text)) | ast.arg(arg=text) | ast.AnnAssign(target=ast.Name(id=text)):
                    found[text].add(name)
                case ast.Assign(targets=[ast.Name(id=text)]):
                    found[text].add(name)
    return found


def test_few_files_name_a_rule():
    named = {name: files_by_name()[name] for name in NAMES}
    assert {name: files for name, files in named.items() if "paddock/rules/race.py" not in files} == {}
    assert {name: sorted(files) for name, files in named.items() if len(files) > MOST} == {}


@pytest.mark.parametrize("name", ["collision_penalty_ms", "max_resets", "minimum_laps", "mercy_resets", "duel_gap_m"])
def test_few_files_mention_a_rule_at_all(name):
    files = [one for one in product_files() if re.search(rf"\b{name}\b", (ROOT / one).read_text())]
    assert len(files) <= MOST, files

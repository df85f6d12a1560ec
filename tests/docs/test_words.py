"""One name for one thing: class names stand once, and words that were given up do not come back."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

from tests.shared import CHECKOUT

ROOMS = ("paddock", "core", "accounts", "tracks", "evaluation", "videos", "races", "training", "league", "config")
SKIPPED = {"migrations", "__pycache__"}
ONCE_FOR_EACH = {"Command", "Meta"}  # Django's own names

# Word: where it may stand, and why
GIVEN_UP = {
    r"film(s|ed|ing|er)?": {},  # a video
    r"course(?<!of course)": {
        "config/carry_over.py": "a column of before 0.1.0",
        "docs/architecture.md": "the glossary",
        "training/views/learn.py": "the lessons",
        "training/templates": "the lessons",
        "templates/learn": "the lessons",
    },
    r"contestants?": {},  # a competitor
    r"behind (the|a|its|same) wall": {},  # the sandbox
    r"walled([- ]off)?": {},
    r"in_line|start line": {},  # the queue; the finish line
}


def sources(*endings: str) -> list[Path]:
    """The files of the rooms, of the pages and of the docs, by their endings."""
    folders = [CHECKOUT / name for name in (*ROOMS, "templates", "docs")]
    return [
        path
        for folder in folders
        for path in sorted(folder.rglob("*"))
        if path.suffix in endings and not SKIPPED & {*path.parts} and path.is_file()
    ]


def test_class_names_stand_once():
    homes = defaultdict(list)
    for path in sources(".py"):
        tree = ast.parse(path.read_text("utf-8"))
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and node.name not in ONCE_FOR_EACH:
                homes[node.name].append(str(path.relative_to(CHECKOUT)))
    assert len(homes) > 500
    assert {name: found for name, found in homes.items() if len(found) > 1} == {}


@pytest.mark.parametrize("word", GIVEN_UP)
def test_a_word_that_was_given_up_does_not_come_back(word):
    pattern = re.compile(rf"(?<![\w-])({word})(?![\w-])", re.IGNORECASE)
    allowed = GIVEN_UP[word]
    found = [
        f"{path.relative_to(CHECKOUT)}:{number}: {line.strip()[:100]}"
        for path in sources(".py", ".html", ".md")
        if not str(path.relative_to(CHECKOUT)).startswith((*allowed,))
        for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1)
        if pattern.search(line)
    ]
    assert found == []

"""One name for one thing: class names stand once, and words that were given up do not come back."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

from tests.docs import word_counts
from tests.docs.word_counts import ROOMS
from tests.shared import CHECKOUT

SKIPPED = {"migrations", "__pycache__"}
ONCE_FOR_EACH = {"Command", "Meta"}  # Django's own names

# Word: where it may stand, and why
GIVEN_UP = {
    r"film(s|ed|ing|er)?": {},  # a video
    r"course(?<!of course)": {
        "docs/architecture.md": "the glossary",
        "courses": "what a platform calls the students of a term",
        "templates/courses": "the same",
        "docs/courses.md": "the same",
        "docs/operators.md": "the same",
        "docs/reference.md": "the same",
        "training/lessons/views.py": "the lessons",
        "training/templates": "the lessons",
        "templates/training/lessons": "the lessons",
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
        if pattern.search(text := path.read_text("utf-8"))
        for number, line in enumerate(text.splitlines(), start=1)
        if pattern.search(line)
    ]
    assert found == []


@pytest.mark.parametrize("room", ROOMS)
def test_the_count_of_dialect_only_falls(room):
    bounds, places = word_counts.stored()[room], word_counts.places(room)
    more = {kind: finds for kind, finds in places.items() if len(finds) > bounds[kind]}
    assert not more, f"{ ({kind: len(finds) for kind, finds in more.items()}) } of {bounds}: write plain English"
    lower = {kind: len(finds) for kind, finds in places.items() if len(finds) < bounds[kind]}
    assert not lower, f"the count fell to {lower}: store it with .venv/bin/python -m tests.docs.word_counts"


def test_the_counter_finds_each_kind_of_dialect(tmp_path, monkeypatch):
    monkeypatch.setattr(word_counts, "CHECKOUT", tmp_path)
    file = tmp_path / "example.py"
    file.write_text(
        '"""Racers who drive are fine. Whoever waits is told."""\n\n'
        "told_before = 1  # of who came first\n"
        "# the room's racers,\n# who are no clause here\n"
        'text = "who in a text is none"\n'
    )
    kinds = {kind: [int(find.split(":")[1]) for find in finds] for kind, finds in word_counts.found(file).items()}
    assert kinds == {"said": [1], "names": [3], "who": [1, 3, 5]}

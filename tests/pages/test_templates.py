"""All templates: they compile, hold no script or style of their own, and their lines are short."""

from __future__ import annotations

import re

from django.contrib.staticfiles.finders import find
from django.template.loader import get_template

from tests.pages.test_pages import INLINE
from tests.shared import CHECKOUT

FOLDER = CHECKOUT / "templates"
TEMPLATES = {path.relative_to(FOLDER).as_posix(): path.read_text() for path in sorted(FOLDER.rglob("*.html"))}
LONGEST = 160


def test_all_compile():
    for name in TEMPLATES:
        get_template(name)


def test_none_has_an_inline_script_or_style():
    assert {name: found[0] for name, text in TEMPLATES.items() if (found := INLINE.search(text))} == {}


def test_their_static_files_exist():
    """While developing, a page with the address of a missing file is shown without an error."""
    named = {name for text in TEMPLATES.values() for name in re.findall(r"{% static ['\"]([^'\"]+)", text)}
    assert len(named) > 20 and not [name for name in sorted(named) if not find(name)]


def test_no_line_is_long():
    lines = [(name, *each) for name, text in TEMPLATES.items() for each in enumerate(text.splitlines(), 1)]
    assert [(name, number) for name, number, line in lines if len(line) > LONGEST] == []

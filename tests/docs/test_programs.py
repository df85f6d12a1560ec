"""Programs that the pages start by a module's name exist."""

from __future__ import annotations

import re
from importlib.util import find_spec

import pytest
from celery import Celery
from celery.app.utils import find_app

from .pages import CHECKOUT, DECISIONS, everything

OTHERS = "\n".join(
    page.read_text() for page in (*DECISIONS, *(CHECKOUT / f"{name}.md" for name in ("README", "CHANGELOG")))
)
PROSE = everything() + OTHERS + (CHECKOUT / "CONTRIBUTING.md").read_text()


@pytest.mark.parametrize("module", sorted(set(re.findall(r"python -m ([a-z]\w*(?:\.\w+)*)", PROSE))))
def test_every_module_run_by_a_program_exists(module: str):
    assert find_spec(module) is not None


def test_celery_is_started_with_our_application():
    named = set(re.findall(r"celery (?:--app|-A) (\w+)", PROSE))
    assert len(named) == 1
    app = find_app(named.pop())
    assert isinstance(app, Celery) and app.main == "paddock"

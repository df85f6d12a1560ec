"""A changed text needs no migration; a changed column does."""

from __future__ import annotations

from typing import Any

import pytest
from django.core.management import get_commands, load_command_class
from django.db import models
from django.db.migrations.state import ModelState, ProjectState

from core.database.migration_detector import TextBlindAutodetector

BEFORE: dict[str, Any] = {"max_length": 20, "verbose_name": "name", "choices": [("a", "An A")]}


def changes(field: dict[str, Any], options: dict[str, Any]) -> dict:
    def state(field: dict[str, Any], options: dict[str, Any]) -> ProjectState:
        project = ProjectState()
        fields = [("id", models.AutoField(primary_key=True)), ("name", models.CharField(**field))]
        project.add_model(ModelState("shop", "Toy", fields, options))
        return project

    before = state(BEFORE, {"verbose_name": "toy", "ordering": ["name"]})
    detector = TextBlindAutodetector(
        before, state(BEFORE | field, {"verbose_name": "toy", "ordering": ["name"]} | options)
    )
    return detector._detect_changes()


@pytest.mark.parametrize(
    ("field", "options"),
    [
        ({"verbose_name": "title", "help_text": "As on the box."}, {}),
        ({"choices": [("a", "An A"), ("b", "A B")]}, {}),
        ({}, {"verbose_name": "game", "verbose_name_plural": "games"}),
    ],
)
def test_a_changed_text_needs_no_migration(field: dict, options: dict) -> None:
    assert not changes(field, options)


@pytest.mark.parametrize(
    ("field", "options"),
    [({"max_length": 30, "verbose_name": "title"}, {}), ({}, {"ordering": ["-name"], "verbose_name": "game"})],
)
def test_other_changes_need_one(field: dict, options: dict) -> None:
    assert list(changes(field, options)) == ["shop"]


@pytest.mark.parametrize("name", ["makemigrations", "migrate"])
def test_the_commands_use_it(name: str) -> None:
    assert load_command_class(get_commands()[name], name).autodetector is TextBlindAutodetector

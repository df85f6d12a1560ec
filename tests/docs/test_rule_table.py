"""The generated tables of the docs (rules, ranking methods, sensors, formats, metrics and more) are current."""

import pytest

from . import default_configuration, metric_table, notice_table, ranking_table, small_tables
from .pages import text
from .rule_table import replaced


def test_the_table_is_generated_from_the_rules():
    assert text("reference.md") == replaced(text("reference.md"))


def test_the_default_configuration_is_generated_from_the_code():
    page = text("environments.md")
    assert page == default_configuration.replaced(page)


@pytest.mark.parametrize("page", ranking_table.PAGES, ids=lambda page: page.name)
def test_the_guides_describe_every_ranking_method(page):
    assert page.read_text() == ranking_table.replaced(page.read_text())


def test_the_table_of_notices_is_generated_from_their_kinds():
    assert text("api.md") == notice_table.replaced(text("api.md"))


def test_the_table_of_metrics_is_generated_from_the_metrics():
    assert text("operators.md") == metric_table.replaced(text("operators.md"))


@pytest.mark.parametrize("name", small_tables.TABLES)
def test_the_small_tables_are_generated_from_their_registries(name):
    page = text("reference.md")
    assert page == small_tables.replaced(page, name), "write it with: python -m tests.docs.small_tables"

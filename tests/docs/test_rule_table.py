"""The table of rules in the docs is that of the list."""

from .pages import text
from .rule_table import replaced


def test_the_table_is_generated_from_the_rules():
    assert text("rules.md") == replaced(text("rules.md"))

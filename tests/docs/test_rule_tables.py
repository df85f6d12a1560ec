"""The tables of rules in the docs are those of the list."""

import pytest

from .pages import text
from .rule_tables import PAGES, replaced


@pytest.mark.parametrize("page", PAGES)
def test_the_table_is_written_from_the_list(page):
    assert text(page) == replaced(text(page), PAGES[page]())

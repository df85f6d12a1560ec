"""Shared parts of pages that outlive a commit, as a page keeps them for its next reader."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from django.test import override_settings

from core.database.commit_cache import Unchanged
from core.streams import shared_pieces


@contextmanager
def parts_are_kept() -> Iterator[None]:
    """Keep shared parts also within the transaction of a test, for as long as this lasts."""
    parts = {"is_shared": lambda: True, "LIVES_S": 3600.0, "_parts": Unchanged(400), "_newest": shared_pieces._Newest()}
    parts["_lasting"] = shared_pieces._Lasting(40)
    with patch.multiple(shared_pieces, **parts), override_settings(SHARED_PAGE_SECONDS=3600):
        yield

"""The community's own reader of logs, deepracer-utils: imported by who reads with it, for pandas and matplotlib come
along, a second of a processor wherever tests are collected."""

from __future__ import annotations

from functools import cache
from types import ModuleType


@cache
def community() -> ModuleType:
    """``deepracer.logs``, with its ``metrics`` and ``misc``."""
    from deepracer import logs
    from deepracer.logs import metrics, misc  # noqa: F401

    return logs

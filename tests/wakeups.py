"""Wake-ups that tests listen to, instead of a broker."""

from __future__ import annotations

from typing import Any

import pytest

from core.wakeups import workers as wakeup


def heard(monkeypatch: pytest.MonkeyPatch, task: str) -> list[dict[str, Any]]:
    """The options of every message for a task, from now on; none of them reaches a broker."""
    messages: list[dict[str, Any]] = []
    others = wakeup.publish

    def publish(name: str, **options: Any) -> None:
        if name == task:
            messages.append(options)
        else:
            others(name, **options)

    monkeypatch.setattr(wakeup, "publish", publish)
    return messages

"""What a reason is: a code, whose fault it is, and the sentence a racer reads. No Django here.

The sentence says what is wrong and what to do. ``%(name)s`` placeholders come from the error's params.
``gettext_noop`` only marks the text for translation; pages translate it when they show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


def gettext_noop(text: str) -> str:
    """Mark a text for ``makemessages`` without importing Django."""
    return text


@dataclass(frozen=True)
class Reason:
    """One reason code. ``fault`` is ``"user"`` or ``"platform"``."""

    code: str
    fault: str
    sentence: str

    def render(self, params: dict[str, Any], sentence: str | None = None) -> str:
        """The sentence (or its translation ``sentence``) with ``params`` filled in; a missing one shows as ``?``."""
        return (sentence or self.sentence) % _Params(params)


class _Params(dict):
    def __missing__(self, key: str) -> str:
        return "?"


def table(fault: str, sentences: dict[str, str]) -> dict[str, Reason]:
    """Reasons of one kind of fault by code, from their sentences."""
    return {code: Reason(code, fault, sentence) for code, sentence in sentences.items()}

"""What a reason is: a code, whose fault it is, and the sentence a racer reads. No Django here.

Each package keeps the reasons that it raises in its own ``reasons.py``, which its ``__init__`` loads. A sentence says
what is wrong and what to do. ``%(name)s`` placeholders come from the error's params. ``gettext_noop`` only marks the
text for translation; pages translate it when they show it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

FAULTS = ("user", "platform")


def gettext_noop(text: str) -> str:
    """Mark a text for ``makemessages`` without importing Django."""
    return text


@dataclass(frozen=True)
class Reason:
    """One reason code. ``fault`` is one of :data:`FAULTS`; ``subject`` is the heading that the docs list it under."""

    code: str
    fault: str
    sentence: str
    subject: str

    def render(self, params: dict[str, Any], sentence: str | None = None) -> str:
        """The sentence (or its translation ``sentence``) with ``params`` filled in; a missing one shows as ``?``."""
        return (sentence or self.sentence) % _Params(params)


class _Params(dict):
    def __missing__(self, key: str) -> str:
        return "?"


# All that are registered by now, by code
REASONS: dict[str, Reason] = {}


def register(subject: str, fault: str, sentences: Mapping[str, str]) -> dict[str, Reason]:
    """Add reasons of one kind of fault, as sentences by code, and return them.

    Raises ValueError for a fault that there is not, and for a code that another package has.
    """
    if fault not in FAULTS:
        raise ValueError(f"a fault is one of {FAULTS}, not {fault!r}")
    if twice := REASONS.keys() & sentences.keys():
        raise ValueError(f"these codes have a sentence already: {', '.join(sorted(twice))}")
    made = {code: Reason(code, fault, sentence, subject) for code, sentence in sentences.items()}
    REASONS.update(made)
    return made


def platform_codes() -> list[str]:
    """The codes that are Paddock's own fault."""
    return [code for code, reason in REASONS.items() if reason.fault == "platform"]

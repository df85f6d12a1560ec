"""Every reason code, whose fault it is, and the sentence a racer reads. No Django here.

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


def _table(fault: str, sentences: dict[str, str]) -> dict[str, Reason]:
    return {code: Reason(code, fault, sentence) for code, sentence in sentences.items()}


_ = gettext_noop

# --- upload ---------------------------------------------------------------------------------------------------------
_UPLOAD = _table("user", {})

# --- metadata -------------------------------------------------------------------------------------------------------
_METADATA = _table("user", {})

# --- conversion -----------------------------------------------------------------------------------------------------
_CONVERSION = _table("user", {})

# --- gate -----------------------------------------------------------------------------------------------------------
_GATE = _table("user", {})

# --- run time -------------------------------------------------------------------------------------------------------
_RUN_TIME = _table(
    "user",
    {
        "non_finite_action": _(
            "The network answered NaN or infinity in step %(step)s. Check its weights and train it again."
        ),
    },
)

# --- platform -------------------------------------------------------------------------------------------------------
_PLATFORM = _table("platform", {})

# --- tracks ---------------------------------------------------------------------------------------------------------
_TRACKS = _table("user", {})

# --- race -----------------------------------------------------------------------------------------------------------
_RACE = _table("user", {})

REASONS: dict[str, Reason] = {
    **_UPLOAD,
    **_METADATA,
    **_CONVERSION,
    **_GATE,
    **_RUN_TIME,
    **_PLATFORM,
    **_TRACKS,
    **_RACE,
}

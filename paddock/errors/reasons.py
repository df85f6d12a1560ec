"""The registry of reasons: code, kind of fault, HTTP status and the sentence for racers."""

# Each package registers the reasons that it raises in its own ``reasons.py``, which its ``__init__`` imports. A
# sentence names the problem and the remedy. ``%(name)s`` placeholders come from the error's params. ``gettext_noop``
# only marks the text for translation; pages translate it when they show it.

from collections import defaultdict
from collections.abc import Mapping
from typing import NamedTuple

# The HTTP status of each kind of reason. conflict: a limit or a state that the caller can change; too_many_requests:
# only waiting helps, and the answer contains the time; unavailable: Paddock's own fault.
KINDS = {
    "invalid": 400,
    "unauthorized": 401,
    "forbidden": 403,
    "not_found": 404,
    "conflict": 409,
    "too_large": 413,
    "too_many_requests": 429,
    "unavailable": 503,
}


def gettext_noop(text: str) -> str:
    """Mark a text for ``makemessages`` without importing Django."""
    return text


class Reason(NamedTuple):
    """One reason code. ``fault`` is ``user`` or ``platform``; ``subject`` is the heading that the docs list it under;
    ``status`` is the HTTP status of an answer with this code."""

    code: str
    fault: str
    sentence: str
    subject: str
    status: int

    def render(self, params: Mapping[str, object], sentence: str | None = None) -> str:
        """The sentence (or its translation ``sentence``) with ``params`` filled in; a missing one shows as ``?``."""
        return (sentence or self.sentence) % defaultdict[str, object](lambda: "?", params)


REASONS: dict[str, Reason] = {}


def register(subject: str, **kinds: Mapping[str, str]) -> dict[str, Reason]:
    """Add reasons and return them. ``kinds``: sentences by code, by the name of their kind in :data:`KINDS`.

    Raises ValueError for an unknown kind, and for a code that is registered already.
    """
    if unknown := kinds.keys() - KINDS:
        raise ValueError(f"the kinds are {[*KINDS]}; not {[*unknown]}")
    made: dict[str, Reason] = {}
    for kind, sentences in kinds.items():
        if twice := sentences.keys() & (REASONS.keys() | made):
            raise ValueError(f"these codes have a sentence already: {', '.join(sorted(twice))}")
        fault = "platform" if kind == "unavailable" else "user"
        made |= {code: Reason(code, fault, text, subject, KINDS[kind]) for code, text in sentences.items()}
    REASONS.update(made)
    return made


def platform_codes() -> list[str]:
    return [code for code, reason in REASONS.items() if reason.fault == "platform"]

"""Counts dialect in product Python, room by room, and holds it against ``word_counts.json``.

``python -m tests.docs.word_counts`` lowers the stored numbers after some of it was rewritten; it never raises one.
"""

from __future__ import annotations

import io
import json
import re
import tokenize
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.shared import CHECKOUT

ROOMS = (
    *("paddock", "core", "accounts", "tracks", "evaluation", "videos"),
    *("races", "training", "league", "courses", "config"),
)
STORED = Path(__file__).with_name("word_counts.json")

_SAID = re.compile(r"\b(told|said|says)\b", re.IGNORECASE)  # as ``grep -wiE`` counts
_IN_NAME = re.compile(r"(?:^|_)(told|said|says|who)(?:_|$)", re.IGNORECASE)
# "who" without a noun before it: at the start, after a mark, or after a word that is no noun
_NO_NOUN = (
    "about|after|against|all|also|among|and|as|at|because|before|behind|beside|between|but|by|except|for|from|if|in|into|is|"
    "of|on|only|or|over|than|that|then|to|under|unless|until|when|where|whether|which|while|with|without"
)
_WHO = re.compile(rf"(?:^|[^\w\s'’)`]\s*|\b(?:{_NO_NOUN})\s+)(?:who|whoever)\b", re.IGNORECASE | re.MULTILINE)
_ANY = re.compile("told|said|says|who", re.IGNORECASE)  # in each find of each kind
KINDS = ("said", "names", "who")


def files(room: str) -> list[Path]:
    """The Python files of a room, without its migrations."""
    return [path for path in sorted((CHECKOUT / room).rglob("*.py")) if "migrations" not in path.parts]


def found(path: Path) -> dict[str, list[str]]:
    """Finds in a file as ``file:line: text``.

    ``said``: lines with told, said or says; ``names``: lines with such a name, or one with "who"; ``who``: clauses of
    docstrings and comments with "who" and no noun before it.
    """
    place, text = path.relative_to(CHECKOUT), path.read_text("utf-8")
    if not _ANY.search(text):
        return {kind: [] for kind in KINDS}
    lines = text.splitlines()

    def shown(numbers: Iterable[int]) -> list[str]:
        return [f"{place}:{number}: {lines[number - 1].strip()[:100]}" for number in numbers]

    clauses = (
        first + passage.count("\n", 0, match.end())
        for first, passage in _prose(text)
        for match in _WHO.finditer(passage)
    )
    return {
        "said": shown(number for number, line in enumerate(lines, start=1) if _SAID.search(line)),
        "names": shown(sorted(_lines_with_names(text))),
        "who": shown(clauses),
    }


def _tokens(text: str) -> Iterator[tokenize.TokenInfo]:
    return tokenize.generate_tokens(io.StringIO(text).readline)


def _prose(text: str) -> Iterator[tuple[int, str]]:
    """Docstrings and comments with their first lines; comments on adjacent lines are one passage."""
    comment: list[str] = []
    at_start, first, last = True, 0, 0
    for token in _tokens(text):
        if token.type == tokenize.COMMENT:
            if comment and token.start[0] != last + 1:
                yield first, "\n".join(comment)
                comment = []
            first, last = (first if comment else token.start[0]), token.start[0]
            comment.append(token.string.lstrip("# "))
        elif token.type == tokenize.STRING and at_start:
            yield token.start[0], token.string.strip("rRbBuU\"'")
        if token.type not in (tokenize.COMMENT, tokenize.NL):
            at_start = token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING)
    if comment:
        yield first, "\n".join(comment)


def _lines_with_names(text: str) -> set[int]:
    return {one.start[0] for one in _tokens(text) if one.type == tokenize.NAME and _IN_NAME.search(one.string)}


def places(room: str) -> dict[str, list[str]]:
    """Every find of a room."""
    each = [found(path) for path in files(room)]
    return {kind: [place for one in each for place in one[kind]] for kind in KINDS}


def counted() -> dict[str, dict[str, int]]:
    """The numbers of every room today."""
    return {room: {kind: len(finds) for kind, finds in places(room).items()} for room in ROOMS}


def stored() -> dict[str, dict[str, int]]:
    """The numbers that no room may exceed."""
    bounds: dict[str, dict[str, int]] = json.loads(STORED.read_text())
    return bounds


def written(numbers: dict[str, dict[str, int]]) -> str:
    """The numbers as JSON, one line for each room."""
    rows = ",\n".join(f'  "{room}": {json.dumps(counts)}' for room, counts in numbers.items())
    return f"{{\n{rows}\n}}\n"


if __name__ == "__main__":
    bounds, today = stored(), counted()
    lower = {room: {kind: min(count, bounds[room][kind]) for kind, count in today[room].items()} for room in ROOMS}
    STORED.write_text(written(lower))
    print(*(f"{room}: {today[room]}" for room in ROOMS), sep="\n")
    print({kind: sum(counts[kind] for counts in today.values()) for kind in KINDS})

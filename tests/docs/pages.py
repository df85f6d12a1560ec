"""The pages of the documentation as tests read them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
CHECKOUT = DOCS.parent
PAGES = sorted(DOCS.glob("*.md"))
RACERS = tuple(
    f"{name}.md" for name in ("racers", "formats", "racing", "results", "live", "training", "rewards", "home")
)
DECISIONS = sorted((DOCS / "decisions").glob("*.md"))


@cache
def text(name: str) -> str:
    """The page ``name`` (such as ``api.md``)."""
    return (DOCS / name).read_text()


def everything() -> str:
    """All pages, one after the other."""
    return "\n".join(text(page.name) for page in PAGES)


def anchors(page: str) -> set[str]:
    """The addresses of a page's headings, as code hosts make them."""
    outside_code = re.sub(r"^```.*?^```", "", page, flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", outside_code, flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def section(page: str, heading: str) -> str:
    """What stands under ``heading`` (with its hashes) up to the next heading of the same or a higher rank."""
    level = heading.split(" ", 1)[0]
    rest = page.split(f"\n{heading}\n", 1)[1]
    return re.split(rf"^#{{1,{len(level)}}} ", rest, maxsplit=1, flags=re.M)[0]


def code_blocks(page: str, language: str) -> list[str]:
    """The blocks of code in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page, flags=re.M | re.S)

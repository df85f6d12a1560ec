"""The Korean catalogue of the guides: ``locale/ko/LC_MESSAGES/guides.po``, collected from ``docs/``.

``python -m tests.docs.korean_guides`` writes it anew after a guide changed, compiles it and tells what has no Korean;
``--check`` only tells, and fails where something lacks. A block whose English changed keeps its old Korean as fuzzy,
with the English before; it is shown in English until somebody has looked at it and taken the mark away.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from gettext import GNUTranslations
from pathlib import Path
from tempfile import TemporaryDirectory

import django

from config.guides.pages import GUIDES, Guide, blocks_of, path_of
from config.guides.translation import DOMAIN, in_language, of_site
from tests.shared import CHECKOUT

LANGUAGE = "ko"
CATALOGUE = CHECKOUT / "locale" / LANGUAGE / "LC_MESSAGES" / f"{DOMAIN}.po"
_HEADER = r"""msgid ""
msgstr ""
"Project-Id-Version: Paddock\n"
"PO-Revision-Date: 2026-11-26 00:00+0000\n"
"Last-Translator: \n"
"Language-Team: \n"
"Language: ko\n"
"MIME-Version: 1.0\n"
"Content-Type: text/plain; charset=UTF-8\n"
"Content-Transfer-Encoding: 8bit\n"
"Plural-Forms: nplurals=1; plural=0;\n"
"""


def quoted(text: str) -> str:
    """``text`` as a string of a catalogue."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def blocks(guides: Iterable[Guide] = GUIDES) -> Iterator[tuple[Guide, int, str]]:
    """Every block of these guides that wants words, with its line."""
    for guide in guides:
        for line, block in blocks_of(path_of(guide).read_text("utf-8")):
            yield guide, line, block


def lacking(guide: Guide) -> list[str]:
    """What of a guide is shown in English to Korean readers, as ``file:line: block``."""
    place = path_of(guide).relative_to(CHECKOUT)
    return [
        f"{place}:{line}: {block}" for _guide, line, block in blocks([guide]) if in_language(block, LANGUAGE) is None
    ]


def template() -> str:
    """The blocks that the site's own catalogue does not know, or that this one says otherwise, with their pages."""
    said_otherwise = set(translations(CATALOGUE))
    pages: dict[str, dict[str, None]] = {}
    for guide, _line, block in blocks():
        if block in said_otherwise or of_site(block, LANGUAGE) is None:
            pages.setdefault(block, {})[f"docs/{guide.slug}.md"] = None
    entries = [f'#: {" ".join(places)}\nmsgid {quoted(block)}\nmsgstr ""\n' for block, places in pages.items()]
    return "\n".join([_HEADER, *entries])


def translations(catalogue: Path) -> dict[str, str]:
    """What a catalogue translates, fuzzy ones left out."""
    with TemporaryDirectory() as folder:
        compiled = Path(folder, "compiled.mo")
        _run("msgfmt", "-o", compiled, catalogue)
        with compiled.open("rb") as file:
            known = GNUTranslations(file)._catalog  # type: ignore[attr-defined]  # no other way to all of them
    return {block: said for block, said in known.items() if block}


def collect() -> None:
    """Write the catalogue anew and compile it."""
    with TemporaryDirectory() as folder:
        collected, merged = Path(folder, "guides.pot"), Path(folder, "guides.po")
        if not CATALOGUE.exists():
            CATALOGUE.write_text(_HEADER, "utf-8")
        # two branches may have brought the same block: the one with a translation stays
        _run("msguniq", "--use-first", "--add-location=file", "-o", CATALOGUE, CATALOGUE)
        collected.write_text(template(), "utf-8")
        _run("msgmerge", "--quiet", "--previous", "--add-location=file", "-o", merged, CATALOGUE, collected)
        _run("msgattrib", "--no-obsolete", "--add-location=file", "-o", CATALOGUE, merged)
    compile_catalogue(CATALOGUE.with_suffix(".mo"))


def compile_catalogue(to: Path) -> None:
    """What the site reads."""
    _run("msgfmt", "--check", "-o", to, CATALOGUE)


def _run(*command: str | Path) -> None:
    subprocess.run(command, check=True)


if __name__ == "__main__":
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    django.setup()
    if "--check" not in sys.argv:
        collect()
    missing = [line for guide in GUIDES for line in lacking(guide)]
    print("\n".join([*missing, f"{len(missing)} blocks are not in Korean"]))
    sys.exit(bool(missing) and "--check" in sys.argv)

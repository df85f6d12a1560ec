"""Makes pages of the site from the guides of ``docs/``, and searches them.

Pages are translated block by block (:mod:`config.guides.translation`). Anchors are those of the English headings in
every language. HTML in a file is shown as text.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from django.conf import settings
from django.urls import reverse
from django.utils.functional import Promise
from django.utils.html import escape
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import gettext_lazy as _
from markdown_it import MarkdownIt
from markdown_it.token import Token

from config.guides.translation import in_language, needs_words, one_line

MOST_FOUND = 30
LONGEST_SEARCH = 64
_EXCERPT = 180
_COMMENT = re.compile(r"^<!--.*?-->\n?", flags=re.M | re.S)


@dataclass(frozen=True)
class Guide:
    """A page of ``docs/``: ``slug``.md. ``split_from``: the guide that once held its sections."""

    slug: str
    title: str | Promise
    about: str | Promise
    split_from: str = ""


GUIDES = (
    Guide("racers", _("For racers"), _("From sign-up to the first result.")),
    Guide("formats", _("Uploads and formats"), _("Model files, the ONNX contract, sharing, export."), "racers"),
    Guide("racing", _("Races and boards"), _("Race types, ranking, the league, cups, teams, notices."), "racers"),
    Guide("results", _("Results, test runs and reports"), _("Laps, replays, videos; private runs."), "racers"),
    Guide("analysis", _("Lap analysis"), _("Telemetry, mini-sectors, and where time is lost.")),
    Guide("live", _("Live races"), _("Take part, watch, hide results."), "racers"),
    Guide("training", _("Training"), _("The form, hyperparameters, the learning algorithm."), "racers"),
    Guide("rewards", _("Reward functions"), _("Parameters, limits, modules, examples."), "racers"),
    Guide("home", _("Paddock at home"), _("The command, local runs, proofs of results."), "racers"),
    Guide("organisers", _("For organisers"), _("Run races and seasons; admin tasks.")),
    Guide("courses", _("Assignments"), _("Deadlines, attempts, marks; for teachers and students.")),
    Guide("tracks", _("The tracks"), _("The catalogue, with lengths, corners and difficulty.")),
    Guide("reference", _("Reference tables"), _("Rules, sensors, hyperparameters, reason codes."), "racers"),
    Guide("environments", _("Environments"), _("Gymnasium environments with the race simulator.")),
    Guide("simulator", _("The simulator"), _("The car, its sensors, the referee, known differences.")),
    Guide("api", _("The API"), _("Every operation, tokens, limits, errors.")),
    Guide("webhooks", _("Webhooks"), _("Events that Paddock sends to your programs.")),
    Guide("operators", _("For operators"), _("Install, settings, commands, backup, upgrade.")),
)
MOVED = {"rules": "reference#the-rules-of-a-race"}  # old address: guide and section
_BY_SLUG = {guide.slug: guide for guide in GUIDES}


@dataclass(frozen=True)
class GuideSection:
    """A heading with the text below it, without marks. ``language``: English if nothing of it is translated.
    ``english``: the original heading, line break and text of a translation, for the search."""

    level: int
    title: str
    anchor: str
    text: str
    language: str = "en"
    english: str = ""


@dataclass(frozen=True)
class GuidePage:
    """A rendered guide. ``language``: that of what is translated; ``untranslated``: so many blocks are in English."""

    html: SafeString
    title: str
    sections: tuple[GuideSection, ...]
    language: str
    untranslated: int = 0


@dataclass(frozen=True)
class Found:
    """A section that contains all words of a search."""

    guide: Guide
    section: GuideSection
    excerpt: str


def guide_named(slug: str) -> Guide | None:
    return _BY_SLUG.get(slug)


def path_of(guide: Guide) -> Path:
    return Path(settings.BASE_DIR) / "docs" / f"{guide.slug}.md"


def page_of(guide: Guide, language: str) -> GuidePage | None:
    """The guide in ``language``, what is not translated in English; None where this installation has no docs."""
    path = path_of(guide)
    return _rendered(path, path.stat().st_mtime_ns, language) if path.is_file() else None


def sections_split_from(guide: Guide, language: str) -> list[tuple[Guide, list[GuideSection]]]:
    """The guides that ``guide`` was split into, with their sections; each anchor occurs once."""
    page = page_of(guide, language)
    taken = {section.anchor for section in page.sections} if page else set()
    parts = []
    for part in GUIDES:
        if part.split_from == guide.slug and (page := page_of(part, language)):
            sections = [section for section in page.sections if section.anchor not in taken]
            taken |= {section.anchor for section in sections}
            parts.append((part, sections))
    return parts


def blocks_of(text: str) -> list[tuple[int, str]]:
    """The blocks of a guide that are to be translated, each on one line, with the number of the file's line."""
    lines = 0
    found = []
    for token in _parsed(text):
        lines = token.map[0] + 1 if token.map else lines
        if token.type == "inline" and needs_words(block := one_line(token.content)):
            found.append((lines, block))
    return found


def search(words: str, language: str) -> list[Found]:
    """Sections of all guides that hold every word, those first whose headings do; at most :data:`MOST_FOUND`."""
    wanted = words.lower().split()
    if not wanted:
        return []
    found: list[tuple[bool, Found]] = []
    for guide in GUIDES:
        page = page_of(guide, language)
        for section in page.sections if page else ():
            title = f"{section.title}\n{section.english.partition(chr(10))[0]}".lower()
            searched = f"{section.title}\n{section.text}\n{section.english}".lower()
            if all(word in searched for word in wanted):
                in_title = all(word in title for word in wanted)
                found.append((not in_title, Found(guide, section, _excerpt(section.text, wanted))))
    return [each for _title, each in sorted(found, key=lambda pair: pair[0])][:MOST_FOUND]


def anchor_of(heading: str) -> str:
    """The address of a heading within its page, as code hosts make it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


_MARKDOWN = MarkdownIt("commonmark", {"html": False}).enable("table")


def _parsed(text: str) -> list[Token]:
    # a comment leaves its line breaks, so that lines keep their numbers
    return _MARKDOWN.parse(_COMMENT.sub(lambda comment: "\n" * comment[0].count("\n"), text))


@lru_cache(maxsize=4 * len(GUIDES))
def _rendered(path: Path, changed_ns: int, language: str) -> GuidePage:
    tokens = _parsed(path.read_text("utf-8"))
    written = _sections(tokens)
    sections, translated, untranslated = written, 0, 0
    if language != "en":
        translated, untranslated = _translate(tokens, language)
        sections = tuple(_with_source(*pair, language) for pair in zip(_sections(tokens), written, strict=True))
    for token in tokens:
        _address(token.children or ())
    headings = iter(sections)
    shown: list[Token] = []
    for index, token in enumerate(tokens):
        if token.type == "heading_open":
            token.attrSet("id", next(headings).anchor)
        if token.type == "th_open" and not tokens[index + 1].content:  # nothing heads that column
            token.tag = tokens[index + 2].tag = "td"
        if token.type in ("th_open", "td_open"):  # an alignment needs a style, which pages forbid
            style = token.attrs.pop("style", "")
            token.attrs |= {"class": "num"} if style == "text-align:right" else {}
        if token.type == "table_open":
            shown.append(_html('<div class="scroll">'))
        shown.append(token)
        if token.type == "table_close":
            shown.append(_html("</div>"))
    html = _MARKDOWN.renderer.render(shown, _MARKDOWN.options, {})
    title = sections[0].title if sections else path.stem
    spoken = language if translated else "en"
    return GuidePage(mark_safe(html), title, sections, spoken, untranslated)  # html=False: the file's own is escaped


def _translate(tokens: Sequence[Token], language: str) -> tuple[int, int]:
    """Translate every block and mark untranslated ones as English. Returns the counts of both."""
    translated = left = 0
    for token in tokens:
        if token.type != "inline" or not needs_words(block := one_line(token.content)):
            continue
        if (words := in_language(block, language)) is not None:
            token.content, token.children = words, _MARKDOWN.parseInline(words)[0].children
            translated += 1
        else:
            token.children = [_html('<span lang="en">'), *(token.children or ()), _html("</span>")]
            left += 1
    return translated, left


def _with_source(shown: GuideSection, written: GuideSection, language: str) -> GuideSection:
    """A translated section with the anchor of the English one, and its words for the search."""
    same = (shown.title, shown.text) == (written.title, written.text)
    english = "" if same else f"{written.title}\n{written.text}"
    return replace(shown, anchor=written.anchor, language="en" if same else language, english=english)


def _html(text: str) -> Token:
    return Token("html_inline", "", 0, content=text)


def _address(inside: Sequence[Token]) -> None:
    """Let links lead to pages of the site; one to a file that is no guide, and a picture, become words."""
    kept: list[bool] = []
    for token in inside:
        if token.type == "link_open":
            target = _target(str(token.attrGet("href") or ""))
            kept.append(target is not None)
            if target is None:
                token.type, token.tag, token.attrs = "html_inline", "", {}
            else:
                token.attrSet("href", target)
        elif token.type == "link_close" and not kept.pop():
            token.type = "html_inline"
        elif token.type == "image":
            token.type, token.content, token.attrs = "html_inline", f"<em>{escape(token.content)}</em>", {}


def _target(href: str) -> str | None:
    """Where a link of a guide leads here; None for a file that no page shows."""
    file, _mark, anchor = href.partition("#")
    if not file or file.startswith(("https://", "http://")):
        return href
    guide = _BY_SLUG.get(file.removesuffix(".md")) if file.endswith(".md") else None
    if guide is None:
        return None
    return reverse("guide", args=[guide.slug]) + (f"#{anchor}" if anchor else "")


def _sections(tokens: Sequence[Token]) -> tuple[GuideSection, ...]:
    made: list[GuideSection] = []
    used: dict[str, int] = {}
    heading: tuple[int, str] | None = None
    text: list[str] = []

    def end() -> None:
        if heading is not None:
            anchor = anchor_of(heading[1])
            used[anchor] = number = used.get(anchor, -1) + 1
            plain = " ".join(" ".join(text).split())
            made.append(GuideSection(heading[0], heading[1], f"{anchor}-{number}" if number else anchor, plain))

    for index, token in enumerate(tokens):
        if token.type == "heading_open":
            end()
            heading, text = (int(token.tag[1:]), "".join(_words(tokens[index + 1]))), []
        elif token.type in ("inline", "fence", "code_block") and tokens[index - 1].type != "heading_open":
            text.append("".join(_words(token)))
    end()
    return tuple(made)


def _words(token: Token) -> Iterator[str]:
    """The visible text of a token."""
    if token.children is None:
        yield token.content
    for child in token.children or ():
        if child.type != "html_inline":
            yield " " if child.type in ("softbreak", "hardbreak") else child.content


def _excerpt(text: str, wanted: Sequence[str]) -> str:
    places = [place for word in wanted if (place := text.lower().find(word)) >= 0]
    start = max(min(places, default=0) - _EXCERPT // 3, 0)
    if start:
        start = text.find(" ", start) + 1
    cut = text[start : start + _EXCERPT]
    return ("… " if start else "") + cut + (" …" if start + _EXCERPT < len(text) else "")

"""Translates the guides of ``docs/`` block by block.

A block is one paragraph, heading, list item or table cell: its Markdown, on one line. Its translation comes from the
catalogue ``guides`` (``locale/<language>/LC_MESSAGES/guides.po``), then from the site's own catalogue. A block without
a translation stays in English, so that no guide shows an outdated one.
"""

import re
from collections.abc import Callable
from functools import lru_cache
from gettext import NullTranslations, translation

from django.conf import settings
from django.utils.translation import gettext, override, pgettext

from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RULES, RUN_RULES
from paddock.rules.rule import Rule

DOMAIN = "guides"
_RACE_TYPES = {"object_avoidance": "object avoidance", "head_to_head": "head-to-head"}
_SHOWN_AS_IT_IS = re.compile(r"`[^`]*`|\]\([^)]*\)|https?://\S+")
_WORD = re.compile(r"[^\W\d_]{2,}")
_NO_WORDS = frozenset(("kB", "MB", "GB", "ms", "mm", "cm", "km", "kg", "Hz", "kHz", "px", "fps", "ccw", "cw", "UTC"))
_PARAMETER = re.compile(r"\*(\w+)\*")
_SENTENCE = re.compile(r"(?=.*\s).*[.?!]|.*\*\w+\*.*")
_RANGE = re.compile(r"([-\d][\d. ]*) to ([-\d][\d. ]*)")
_PLACE = re.compile(r"%\((\w+)\)s")


def one_line(block: str) -> str:
    """A block's Markdown without the line breaks of its file."""
    return " ".join(block.split())


def needs_words(block: str) -> bool:
    """Whether a block needs a translation: figures, units, code and names of tracks do not."""
    shown = _SHOWN_AS_IT_IS.sub(" ", block)
    words = [word for word in _WORD.findall(shown) if word not in _NO_WORDS]
    return bool(words) and block not in _names_of_tracks()


def in_language(block: str, language: str) -> str | None:
    """``block`` (one line) in ``language``; None where it is not translated."""
    return (block and _own_catalogue(language).gettext(block)) or of_site(block, language)


def of_site(block: str, language: str) -> str | None:
    """The translation of ``block`` in the site's own catalogue, or None."""
    return _rule_meanings(language).get(block) or _plainly(block, language)


def rule_meaning(rule: Rule, say: Callable[[str], str] = str, joined: str = " and ") -> str:
    """The row of a rule in the table of rules: race types, label and help, translated by ``say``."""
    label = pgettext(rule.context, rule.label) if rule.context and say is not str else say(rule.label)
    meaning = f"{label}. {say(rule.help) if rule.help else ''}".strip()
    types = joined.join(say(_RACE_TYPES[one]) for one in rule.race_types)
    return f"{types.capitalize()}: {meaning}" if types else meaning


@lru_cache
def _names_of_tracks() -> frozenset[str]:
    return frozenset(track.name for track in CATALOGUE)


class _Nothing(NullTranslations):
    """Returns nothing for an unknown message; gettext returns the message, which may also be its translation."""

    def gettext(self, message: str) -> str:
        return ""


@lru_cache
def _own_catalogue(language: str) -> NullTranslations:
    known = translation(DOMAIN, settings.LOCALE_PATHS[0], [language], fallback=True)
    known.add_fallback(_Nothing())
    return known


@lru_cache
def _rule_meanings(language: str) -> dict[str, str]:
    """The sentences of the table of rules with their translation, where the site's catalogue has all parts of one."""
    unknown: list[str] = []

    def say(text: str) -> str:
        translated = gettext(text)
        unknown.extend([text] if translated == text else [])
        return translated

    found = {}
    with override(language):
        for rule in (*RULES.values(), *RUN_RULES.values()):
            unknown.clear()
            meaning = rule_meaning(rule, say, ", ")
            if not unknown:
                found[rule_meaning(rule)] = meaning
    return found


def _plainly(block: str, language: str) -> str | None:
    """The translation of a sentence in the site's own catalogue, which has placeholders for the italics of the guides.
    Sentences only: a single word has several meanings."""
    if bounds := _RANGE.fullmatch(block):
        with override(language):
            return gettext("%(least)s to %(most)s") % {"least": bounds[1], "most": bounds[2]}
    if not _SENTENCE.fullmatch(block):
        return None
    with_places = _PARAMETER.sub(r"%(\1)s", block.replace("%", "%%"))
    with override(language):
        for asked in (block, with_places):
            if (found := gettext(asked)) != asked:
                return _PLACE.sub(r"*\1*", found).replace("%%", "%") if asked is with_places else found
    return None

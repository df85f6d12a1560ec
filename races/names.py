"""Names that the house gives, in the reader's language.

A race's name is data, written once. Those of the league are composed of parts ("November pro · Cosmic Circuit", "Season
2027 · championship"), and the house's own races have fixed ones; both are put into the reader's language where they are
shown. What anybody else has named stays as it was written, and so does the name of a track.
"""

from __future__ import annotations

import re
from functools import lru_cache

from django.utils.dates import MONTHS
from django.utils.translation import get_language, gettext

_SEPARATOR = " · "
_MONTHS = {
    name: number
    for number, name in enumerate(
        (
            *("January", "February", "March", "April", "May", "June"),
            *("July", "August", "September", "October", "November", "December"),
        ),
        start=1,
    )
}
_SEASON = re.compile(r"Season (\d{4}(?:-\d{2})?)")
_DIVISION = re.compile(r"division (\d+)")
_texts: set[str] = set()


def house_text(text: str) -> str:
    """The text as it is; from now on :func:`named` puts it into the reader's language."""
    _texts.add(text)
    return text


def named(text: str) -> str:
    """A name or description as a page shows it in the present language."""
    return _named(text, get_language() or "en") if text else text


@lru_cache(maxsize=4096)
def _named(text: str, language: str) -> str:
    if language == "en":
        return text
    if text in _texts:
        return gettext(text)
    return _SEPARATOR.join(_part(part) for part in text.split(_SEPARATOR))


def _part(part: str) -> str:
    month, _, word = part.partition(" ")
    if month in _MONTHS and word in ("", "open", "pro", "finale"):
        pattern = {
            "": "%(month)s",
            "open": gettext("%(month)s open"),
            "pro": gettext("%(month)s pro"),
            "finale": gettext("%(month)s finale"),
        }[word]
        return pattern % {"month": MONTHS[_MONTHS[month]]}
    if season := _SEASON.fullmatch(part):
        return gettext("Season %(years)s") % {"years": season[1]}
    if division := _DIVISION.fullmatch(part):
        return gettext("division %(number)s") % {"number": division[1]}
    if part in _texts:
        return gettext(part)
    return gettext("championship") if part == "championship" else part


def names_track(name: str, track: str) -> bool:
    """Whether a race's name says where it is driven, so that the track's need not be said beside it."""
    return track.casefold() in name.casefold()

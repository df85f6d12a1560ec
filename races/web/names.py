"""Translation of names that the league composes ("November pro · Cosmic Circuit") and of house races' names."""

import calendar
import re
from functools import lru_cache

from django.utils.dates import MONTHS
from django.utils.translation import get_language, gettext

_SEPARATOR = " · "
_MONTHS = {name: number for number, name in enumerate(calendar.month_name) if name}
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
    """Whether a race's name contains the track's, which is then not shown beside it."""
    return track.casefold() in name.casefold()

"""The rule for texts that other people see: visible characters only.

Refused are control, text-direction, zero-width and other invisible characters, and code points without a character. A
joiner (U+200D) and a presentation selector (U+FE0E, U+FE0F) are accepted between emoji only, reserved pictographs too.
Flags made of tag characters (England) are refused."""

import re
import unicodedata

from django.core.exceptions import ValidationError
from django.db import DataError
from django.utils.translation import gettext_lazy

from paddock.errors.reasons import REASONS

CODE, ONE_LINE = "text_character", "one_line"
# Unicode's Default_Ignorable_Code_Point without those of a category "Other", and the empty braille pattern
_BLANK = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180d\u180f\u2800\u3164\uffa0\ufe00-\ufe0f\U000e0100-\U000e01ef]"
)
_PICTOGRAPH = "[\u2190-\u21ff\u2300-\u23ff\u2600-\u27bf\u2900-\u297f\u2b00-\u2bff\U0001f000-\U0001faff]"
_EMOJI_PARTS = re.compile(
    f"(?<={_PICTOGRAPH})\ufe0f?\u200d(?={_PICTOGRAPH})"
    f"|(?<=[\u00a9\u00ae\u203c\u2049\u2122\u2139\u24c2\u25a0-\u25ff\u3030\u303d\u3297\u3299])[\ufe0e\ufe0f]"
    f"|(?<={_PICTOGRAPH})[\ufe0e\ufe0f]|(?<=[#*0-9])\ufe0f?(?=\u20e3)"
    "|[\U0001f900-\U0001faff]"
)
_LINE_BREAK = re.compile("[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]")
_BLANKS = re.compile("[\u00a0\u1680\u2000-\u200a\u202f\u205f\u3000]")


def normalized(text: str) -> str:
    """``text`` as it is stored: composed (NFC), with plain blanks for all widths of blanks, and ``\\n`` as line end."""
    if text.isascii() and "\r" not in text:
        return text
    return _BLANKS.sub(" ", unicodedata.normalize("NFC", text.replace("\r\n", "\n")))


def invisible_character(text: str, *, lines: bool = False) -> str:
    """The first invisible character, as ``U+202E``; "" for none. ``lines``: line ends and tabs are allowed."""
    if text.isascii() and text.isprintable():
        return ""
    if lines:
        text = text.replace("\r\n", " ").replace("\n", " ").replace("\t", " ")
    text = _EMOJI_PARTS.sub("", _BLANKS.sub(" ", text))
    found = next((mark for mark in text if not mark.isprintable() or _BLANK.match(mark)), "")
    return found and f"U+{ord(found):04X}"


def without_invisible(text: str, *, lines: bool = False) -> str:
    """``text`` without invisible characters, on one line unless ``lines``: for texts that nobody can correct."""
    kept = normalized(text)
    while wrong := invisible_character(kept, lines=lines):
        mark = chr(int(wrong[2:], 16))
        kept = kept.replace(mark, " " if mark.isspace() else "")
    return kept if lines else " ".join(kept.split())


def is_right_to_left(text: str) -> bool:
    """Whether a text has letters of a right-to-left script."""
    return not text.isascii() and any(unicodedata.bidirectional(letter) in ("R", "AL", "AN") for letter in text)


def isolated(text: str) -> str:
    """A right-to-left name between isolates (U+2068, U+2069), for sentences that are shown, not stored."""
    return f"\u2068{text}\u2069" if is_right_to_left(text) else text


def visible_line(text: str, *, lines: bool = False) -> None:
    """A validator of forms and serializers. Raises ValidationError("one_line" | "text_character")."""
    code = ONE_LINE if not lines and _LINE_BREAK.search(text) else CODE
    if wrong := invisible_character(text, lines=lines):
        raise ValidationError(gettext_lazy(REASONS[code].sentence), code, {"character": wrong})


def is_of_nul(error: BaseException) -> bool:
    """Whether a query failed because its text contains NUL, which PostgreSQL cannot store."""
    return isinstance(error, DataError) and "NUL" in str(error)

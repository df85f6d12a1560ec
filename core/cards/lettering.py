"""Text as masks: Pillow's own typeface, and whatever the system has for letters that are not in it."""

import subprocess
import unicodedata
from functools import cache, lru_cache

import numpy as np
from PIL import Image, ImageDraw, ImageFont

_ABSENT = "\uffff"
_PLAIN = str.maketrans({"–": "-", "—": "-", "−": "-", "’": "'", "‘": "'", "“": '"', "”": '"', "…": "...", "×": "x"})
_MOST_LETTERS = 200  # of one text; a longer one has no room in any picture
_PATIENCE_S = 5.0
_HEIGHT, _BASE = 1.4, 1.05  # of a line and of its baseline from above, in sizes


@cache
def own_font(size: float) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont), "Pillow has FreeType"
    return font


@cache
def _other(file: str, index: int, size: float) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(file, size, index=index)


def _has(font: ImageFont.FreeTypeFont, letter: str) -> bool:
    if letter == " ":
        return True
    mask, absent = font.getmask(letter), font.getmask(_ABSENT)
    return mask.size != (0, 0) and (mask.size != absent.size or bytes(mask) != bytes(absent))


@cache
def _font_for(letter: str) -> tuple[str, int] | None:
    """(file, index) of the typeface for a letter: ("", 0) for Pillow's own, a system font, or None for no font."""
    return ("", 0) if _has(own_font(20), letter) else system_font(letter)


def system_font(letter: str) -> tuple[str, int] | None:
    """(file, index) of a system font with the letter, None where there is none."""
    return next((font for font in _system_fonts() if _can_write(font, letter)), None)


@cache
def _system_fonts() -> tuple[tuple[str, int], ...]:
    """All fonts with letters, in the order in which fontconfig takes them; read once per process, none where it
    does not answer."""
    command = ["fc-match", "--sort", "--format", "%{file}\n%{index}\n", "sans"]
    try:
        answer = subprocess.run(command, capture_output=True, timeout=_PATIENCE_S, check=True, text=True)
        files, indices = answer.stdout.split("\n")[0::2], answer.stdout.split("\n")[1::2]
        return tuple((file, int(index)) for file, index in zip(files, indices, strict=False))
    except (OSError, ValueError, subprocess.SubprocessError):
        return ()


def _can_write(font: tuple[str, int], letter: str) -> bool:
    try:
        return _has(_other(*font, 20), letter)
    except (OSError, ValueError):
        return False  # a file that cannot be read, or a font of pictures


def drawable(text: str) -> str:
    """The text without letters that no font here has: accents are taken off first, dashes become plain ones."""
    letters: list[str] = []
    for letter in " ".join(str(text).split())[:_MOST_LETTERS]:
        if unicodedata.category(letter)[0] == "C":
            continue
        if _font_for(letter) is not None:
            letters.append(letter)
            continue
        bare = unicodedata.normalize("NFKD", letter.translate(_PLAIN))
        bare = "".join(one for one in bare if not unicodedata.combining(one))
        letters.append(bare if bare.isascii() else "")
    return "".join(letters).strip()


def is_drawable(text: str) -> bool:
    return all(letter.isspace() or _font_for(letter) is not None for letter in text)


@lru_cache(maxsize=1024)
def mask(text: str, size: float, bold: bool = False) -> np.ndarray:
    """The coverage of each pixel, uint8 (h, w); h and the baseline depend on the size alone."""
    pen = round(size * 0.022, 2) if bold else 0.0
    parts: list[tuple[ImageFont.FreeTypeFont, str]] = []
    for letter in drawable(text):
        name, index = _font_for(letter) or ("", 0)
        font = _other(name, index, size) if name else own_font(size)
        if parts and parts[-1][0] is font:
            parts[-1] = (font, parts[-1][1] + letter)
        else:
            parts.append((font, letter))
    width = sum(font.getlength(run) for font, run in parts)
    picture = Image.new("L", (max(1, int(np.ceil(width + 2 * pen)) + 1), max(1, round(_HEIGHT * size))))
    draw = ImageDraw.Draw(picture)
    x = pen
    for font, run in parts:
        draw.text((x, _BASE * size), run, fill=255, font=font, anchor="ls", stroke_width=pen, stroke_fill=255)
        x += font.getlength(run)
    found = np.asarray(picture)
    found.flags.writeable = False
    return found


@lru_cache(maxsize=1024)
def shortened(text: str, size: float, bold: bool, width: int) -> str:
    """The text, or its beginning and three dots, in at most ``width`` px."""
    text = drawable(text)
    if mask(text, size, bold).shape[1] <= width:
        return text
    low, high = 0, len(text)
    while low < high:
        middle = (low + high + 1) // 2
        if mask(f"{text[:middle].rstrip()}...", size, bold).shape[1] <= width:
            low = middle
        else:
            high = middle - 1
    return f"{text[:low].rstrip()}..."

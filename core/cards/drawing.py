"""Draws a card as a PNG image of 1200 x 630 pixels, with bounds on how many are drawn and kept."""

from __future__ import annotations

import hashlib
import io
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from PIL import Image, ImageDraw

from paddock.errors import PlatformFault

from .lettering import mask, shortened
from .registry import SURFACE, CardFigure, CardRow, CardShape, ShareCard

WIDTH, HEIGHT = 1200, 630
FORMAT = 1  # raise it whenever the picture of the same card changes
MOST_ROWS, MOST_FIGURES = 5, 3
_FINE = 2  # shapes are drawn this much larger, and then reduced
_LEFT, _RIGHT, _TOP = 64, 1148, 52
_TEXT_TO, _TEXT_TO_ALONE = 690, 1136
_PANEL = (732, 112, 1148, 528)  # of the picture: left, top, right, bottom
_GROUND, _LINE = "#0c0f14", "#262d37"
_TEXT, _SOFT, _MUTED, _ACCENT = "#eef1f5", "#c2c9d3", "#919ba8", "#ff3b55"
KEPT = 60  # drawn cards of one process, some 50 kB each; the one asked for longest ago makes way
A_MINUTE = 60  # cards that one process draws, 60 ms each
PATIENCE_S = 3.0


def fingerprint(card: ShareCard) -> str:
    """What a drawn card is known by: hex digits of all that it shows."""
    return hashlib.sha256(repr((FORMAT, card)).encode()).hexdigest()[:32]


class DrawnCards:
    """The cards that this process has drawn last. One is drawn at a time, and few of them a minute, so that many
    requests for different ones leave the processor to the site's readers."""

    def __init__(self, kept: int = KEPT, a_minute: int = A_MINUTE) -> None:
        self._kept, self._a_minute = kept, a_minute
        self._drawn: OrderedDict[str, bytes] = OrderedDict()
        self._times: deque[float] = deque()
        self._lock = threading.Lock()

    def __contains__(self, card: ShareCard) -> bool:
        return fingerprint(card) in self._drawn

    def png(self, card: ShareCard) -> bytes:
        """The card's image. Raises PlatformFault("cards_busy")."""
        name = fingerprint(card)
        if (found := self._drawn.get(name)) is not None:
            with suppress(KeyError):  # another thread has dropped it
                self._drawn.move_to_end(name)
            return found
        if not self._lock.acquire(timeout=PATIENCE_S):
            raise PlatformFault("cards_busy")
        try:
            if (found := self._drawn.get(name)) is None:
                self._count()
                found = self._drawn[name] = draw_card(card)
                while len(self._drawn) > self._kept:
                    self._drawn.popitem(last=False)
            return found
        finally:
            self._lock.release()

    def _count(self) -> None:
        now = time.monotonic()
        while self._times and self._times[0] < now - 60.0:
            self._times.popleft()
        if len(self._times) >= self._a_minute:
            raise PlatformFault("cards_busy")
        self._times.append(now)


drawn_cards = DrawnCards()


def draw_card(card: ShareCard) -> bytes:
    """The PNG image. Texts are shortened to their place; of rows and figures the first are shown."""
    picture = Image.new("RGB", (WIDTH, HEIGHT), _GROUND)
    draw = ImageDraw.Draw(picture)
    text_to = _TEXT_TO if card.picture else _TEXT_TO_ALONE
    _mark(draw, _LEFT, _TOP + 2, 26)
    _write(picture, f"Paddock · {card.kind}", _LEFT + 44, _TOP - 8, 26, _MUTED, bold=True)
    y = _title(picture, card.title, text_to)
    for line in card.lines[:2]:
        _write(picture, line, _LEFT, y, 28, _SOFT, room=text_to - _LEFT)
        y += 42
    if card.rows:
        _rows(picture, draw, card.rows[:MOST_ROWS], text_to)
    elif card.figures:
        _figures(picture, card.figures[:MOST_FIGURES], text_to)
    elif card.note:
        _write(picture, card.note, _LEFT, 500, 28, _MUTED, room=text_to - _LEFT)
    if card.picture:
        draw.rounded_rectangle(_PANEL, 18, fill=SURFACE, outline=_LINE)
        left, top, right, bottom = _PANEL
        _shapes(picture, card.picture, (left + 24, top + 24, right - 24, bottom - 24))
    if card.car:
        _shapes(picture, card.car, (_RIGHT - 168, 26, _RIGHT, 102))
    draw.rectangle((0, HEIGHT - 10, WIDTH, HEIGHT), fill=_ACCENT)
    file = io.BytesIO()
    picture.quantize(128, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
    return file.getvalue()


def _mark(draw: ImageDraw.ImageDraw, x: float, y: float, size: float) -> None:
    """The site's mark (static/mark.svg)."""
    corners = ((6, 1), (20, 1), (14, 19), (0, 19))
    draw.polygon([(x + size * a / 20, y + size * b / 20) for a, b in corners], fill=_ACCENT)


def _title(picture: Image.Image, title: str, text_to: int) -> int:
    """The title in one large line or two smaller ones; where the next line begins."""
    room = text_to - _LEFT
    if mask(title, 64, True).shape[1] <= room:
        _write(picture, title, _LEFT, 104, 64, _TEXT, bold=True)
        return 200
    words, first = title.split(), ""
    while words and mask(f"{first} {words[0]}".strip(), 46, True).shape[1] <= room:
        first = f"{first} {words.pop(0)}".strip()
    lines = (first, " ".join(words)) if first else (title, "")
    for number, line in enumerate(lines):
        _write(picture, line, _LEFT, 100 + 60 * number, 46, _TEXT, bold=True, room=room)
    return 232 if lines[1] else 176


def _rows(picture: Image.Image, draw: ImageDraw.ImageDraw, rows: Sequence[CardRow], text_to: int) -> None:
    y = HEIGHT - 42 - 48 * len(rows)
    for row in rows:
        draw.line((_LEFT, y, text_to, y), fill=_LINE, width=1)
        wide = _write(picture, row.value, text_to, y + 6, 28, _TEXT, bold=True, right=True)
        _write(picture, row.place, _LEFT, y + 6, 28, _ACCENT, bold=True)
        _write(picture, row.name, _LEFT + 52, y + 6, 28, _TEXT, room=text_to - _LEFT - 76 - wide)
        y += 48


def _figures(picture: Image.Image, figures: Sequence[CardFigure], text_to: int) -> None:
    """The first figure alone in a large line, the others below it."""
    first, *others = figures
    _write(picture, first.label, _LEFT, 322 if others else 404, 24, _MUTED, bold=True)
    at = 350 if others else 432
    _write(picture, first.value, _LEFT, at, 84, first.colour or _TEXT, bold=True, room=text_to - _LEFT)
    step = (text_to - _LEFT) // 2
    for number, figure in enumerate(others):
        x = _LEFT + number * step
        _write(picture, figure.label, x, 488, 22, _MUTED, bold=True, room=step - 16)
        _write(picture, figure.value, x, 514, 40, figure.colour or _SOFT, bold=True, room=step - 16)


def _write(
    picture: Image.Image,
    text: str,
    x: int,
    y: int,
    size: float,
    colour: str,
    *,
    bold: bool = False,
    room: int | None = None,
    right: bool = False,
) -> int:
    """Write a text with the upper edge of its line at ``y``; returns its width."""
    if not text:
        return 0
    cover = Image.fromarray(np.ascontiguousarray(mask(shortened(text, size, bold, room or WIDTH), size, bold)))
    picture.paste(colour, (x - cover.width if right else x, y), cover)
    return cover.width


def _shapes(picture: Image.Image, shapes: Sequence[CardShape], place: tuple[int, int, int, int]) -> None:
    """Draw shapes as large as they fit into a place, in its middle."""
    left, top, right, bottom = place
    points = np.array([point for shape in shapes for point in shape.points])
    low, high = points.min(axis=0), points.max(axis=0)
    wide, tall = np.maximum(high - low, 1e-6)
    scale = min((right - left) / wide, (bottom - top) / tall) * _FINE
    over = Image.new("RGBA", ((right - left + 16) * _FINE, (bottom - top + 16) * _FINE))
    draw = ImageDraw.Draw(over)
    for shape in shapes:
        middle = np.array(shape.points) - (low + high) / 2
        at = [(over.width / 2 + x * scale, over.height / 2 - y * scale) for x, y in middle]
        if shape.fill:
            draw.polygon(at, fill=shape.fill)
        if shape.line:
            ends = [*at, at[0]] if shape.closed else at
            draw.line(ends, fill=shape.line, width=max(1, round(shape.width * _FINE)), joint="curve")
    small = over.reduce(_FINE)
    picture.paste(small, (left - 8, top - 8), small)

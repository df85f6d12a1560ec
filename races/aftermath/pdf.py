"""A PDF in any language: Helvetica for Latin letters, a part of a system font for all others (fpdf2 embeds it)."""

from collections.abc import Sequence
from itertools import groupby
from typing import Literal

Colour = tuple[int, int, int]
INK: Colour = (21, 26, 33)
SOFT: Colour = (92, 104, 118)
LINE: Colour = (205, 211, 218)
ACCENT: Colour = (11, 122, 67)
_LATIN = "Helvetica"
_PLAIN = str.maketrans({"–": "-", "—": "-", "−": "-", "’": "'", "‘": "'", "“": '"', "”": '"', "…": "..."})

Align = Literal["left", "right", "middle"]


class Paper:
    """Pages of A4 to write on. Places and widths in mm from the upper left corner, sizes of letters in points."""

    def __init__(self, *, landscape: bool = False, title: str = "", language: str = "en") -> None:
        from fpdf import FPDF  # 16 MB that only the process needs which draws a certificate

        self.pdf = FPDF(orientation="landscape" if landscape else "portrait", format="A4", unit="mm")
        self.pdf.set_auto_page_break(False)
        self.pdf.set_title(title)
        self.pdf.set_creator("Paddock")
        self.pdf.set_lang(language)
        self._fonts: dict[tuple[str, int], str] = {}
        self.pdf.add_page()

    @property
    def width(self) -> float:
        return self.pdf.w

    @property
    def height(self) -> float:
        return self.pdf.h

    def bytes(self) -> bytes:
        """The file. Only the glyphs that were written are in it."""
        return bytes(self.pdf.output())

    def write(
        self,
        text: str,
        x: float,
        y: float,
        size: float,
        *,
        bold: bool = False,
        colour: Colour = INK,
        align: Align = "left",
        most: float | None = None,
    ) -> float:
        """Write one line with its baseline at ``y``, cut to ``most`` mm. Letters without a font are left out."""
        parts = self._cut(_plain(text), size, bold, most)
        width = self._width(parts, size, bold)
        at = x - {"left": 0.0, "right": width, "middle": width / 2}[align]
        self.pdf.set_text_color(*colour)
        for font, part in parts:
            self._choose(font, size, bold)
            self.pdf.text(at, y, part)
            at += self.pdf.get_string_width(part)
        return width

    def fitting(self, text: str, most: float, size: float, *, least: float, bold: bool = False) -> float:
        """The largest size up to ``size`` at which the text is at most ``most`` wide, but no smaller than ``least``."""
        width = self._width(self._parts(_plain(text)), size, bold)
        return size if width <= most else max(least, size * most / width)

    def rule(self, x1: float, y1: float, x2: float, y2: float, *, colour: Colour = LINE, width: float = 0.2) -> None:
        self.shape([(x1, y1), (x2, y2)], colour=colour, width=width)

    def shape(
        self, points: Sequence[tuple[float, float]], *, colour: Colour, width: float, closed: bool = False
    ) -> None:
        self.pdf.set_draw_color(*colour)
        self.pdf.set_line_width(width)
        self.pdf.polyline(points, style="D", polygon=closed)

    def code(self, address: str, x: float, y: float, size: float) -> None:
        """A QR code that leads to an address, ``size`` mm long and wide."""
        import segno

        rows = [list(row) for row in segno.make(address, error="m").matrix]
        module = size / len(rows)
        self.pdf.set_fill_color(*INK)
        for number, row in enumerate(rows):
            column = 0
            for dark, run in groupby(row):
                length = len(list(run))
                if dark:  # a hair longer, so that no printer leaves a gap
                    left, top = x + column * module, y + number * module
                    self.pdf.rect(left, top, length * module + 0.02, module + 0.02, style="F")
                column += length

    # --- which font

    def _parts(self, text: str) -> list[tuple[str, str]]:
        """The text in pieces of one font each: (family, piece)."""
        found = [(self._font(letter), letter) for letter in text]
        return [
            (font, "".join(letter for _, letter in run))
            for font, run in groupby(found, key=lambda each: each[0])
            if font is not None
        ]

    def _font(self, letter: str) -> str | None:
        try:
            letter.encode("latin-1")
        except UnicodeEncodeError:
            pass
        else:
            return _LATIN
        from core.cards.lettering import system_font  # loads Pillow

        font = system_font(letter)
        if font is None:
            return None
        if font not in self._fonts:
            name = f"system{len(self._fonts)}"
            try:
                self.pdf.add_font(name, fname=font[0], collection_font_number=font[1])
            except Exception:  # fpdf2 has many ways to say that it cannot read a font: then its letters are left out
                name = ""
            self._fonts[font] = name
        return self._fonts[font] or None

    def _choose(self, font: str, size: float, bold: bool) -> None:
        self.pdf.set_font(font, style="B" if bold and font == _LATIN else "", size=size)

    def _width(self, parts: list[tuple[str, str]], size: float, bold: bool) -> float:
        width = 0.0
        for font, part in parts:
            self._choose(font, size, bold)
            width += self.pdf.get_string_width(part)
        return width

    def _cut(self, text: str, size: float, bold: bool, most: float | None) -> list[tuple[str, str]]:
        parts = self._parts(text)
        while most is not None and text and self._width(parts, size, bold) > most:
            text = text[:-1].rstrip()
            parts = self._parts(f"{text}...")
        return parts


def _plain(text: str) -> str:
    """One line without what no font has: dashes and quotes that Latin-1 lacks become plain ones."""
    from core.cards.lettering import drawable  # loads Pillow

    return drawable(str(text).translate(_PLAIN))

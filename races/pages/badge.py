"""A badge image for other sites: two boxes with a word each."""

from html import escape

_CHARACTER_PX = 6.6  # of 11 px letters, on average


def badge(label: str, value: str, *, good: bool = True) -> str:
    """A badge image of two boxes, for pages elsewhere: its colours are its own. Any text is escaped and cut."""
    label, value = label[:40], value[:60]
    left, right = (round(14 + _CHARACTER_PX * _wide(text)) for text in (label, value))
    total, colour = left + right, "#0b7a43" if good else "#5c6876"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{total}" height="22" viewBox="0 0 {total} 22" role="img" '
        f'aria-label="{escape(label)}: {escape(value)}"><title>{escape(label)}: {escape(value)}</title>'
        f'<clipPath id="r"><rect width="{total}" height="22" rx="4"/></clipPath><g clip-path="url(#r)">'
        f'<rect width="{left}" height="22" fill="#151a21"/>'
        f'<rect x="{left}" width="{right}" height="22" fill="{colour}"/>'
        f'</g><g fill="#fff" text-anchor="middle" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">'
        f'<text x="{left / 2:g}" y="15" textLength="{left - 12}">{escape(label)}</text>'
        f'<text x="{left + right / 2:g}" y="15" textLength="{right - 12}">{escape(value)}</text></g></svg>\n'
    )


def _wide(text: str) -> float:
    """Letters in the width of Latin ones: Hangul and Chinese are nearly twice as wide."""
    return sum(1.75 if ord(letter) > 0x2E80 else 1 for letter in text)

"""Times and differences as racing writes them."""

from __future__ import annotations


def gap(milliseconds: int) -> str:
    """A difference as ``+s.mmm``, ``+m:ss.mmm`` from a minute on."""
    sign = "+" if milliseconds >= 0 else "−"
    minutes, rest = divmod(abs(milliseconds), 60_000)
    seconds = f"{rest // 1000:02d}" if minutes else f"{rest // 1000}"
    return f"{sign}{f'{minutes}:' if minutes else ''}{seconds}.{rest % 1000:03d}"


def clock(milliseconds: int | None) -> str:
    """A time as ``m:ss.mmm``; a dash for none."""
    if milliseconds is None:
        return "–"
    return f"{milliseconds // 60_000}:{milliseconds // 1000 % 60:02}.{milliseconds % 1000:03}"

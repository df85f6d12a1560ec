"""The default picture of a racer: a pattern of squares like a chequered flag, always the same for one racer."""

from functools import lru_cache
from hashlib import sha256

CELLS = 5
COLOURS = 6  # .avatar-0 to .avatar-5 in the stylesheet


@lru_cache(maxsize=4096)
def pattern(racer_id: int) -> tuple[int, str]:
    """The number of its colour, and an SVG path of the squares on a grid of 5, the same left and right."""
    digest = sha256(f"paddock avatar {racer_id}".encode()).digest()
    half = (CELLS + 1) // 2
    bits = int.from_bytes(digest[1:4], "big")
    on = {at for at in range(half * CELLS) if bits >> at & 1} or {half}
    path = ""
    for row in range(CELLS):
        filled = [column for column in range(CELLS) if min(column, CELLS - 1 - column) * CELLS + row in on]
        path += "".join(f"M{column} {row}h1v1h-1z" for column in filled)
    return digest[0] % COLOURS, path

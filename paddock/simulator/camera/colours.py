"""Gives every grey of a camera's picture one colour, so that a colour picture shows what a race's camera sees."""

# Races have grey cameras. A colour that followed from anything but the grey could not be made again there, and a
# network that learned on colours could not race. So a picture is coloured by a table. The luma of each colour is the
# grey itself, in OpenCV's and in Pillow's arithmetic: a picture that a program turns back to grey is the race's.

from functools import cache

import numpy as np

# Grey, and its colour as the official simulator's surfaces have it: wall, road, box, field, dash, sky, line.
_SURFACES = {
    0: (0, 0, 0),
    14: (4, 18, 20),
    53: (46, 55, 62),
    95: (130, 84, 62),
    134: (88, 164, 102),
    140: (190, 130, 63),
    178: (178, 178, 178),
    212: (212, 212, 212),
    255: (255, 255, 255),
}
_NEAR = 3  # a colour between two surfaces is moved by so much at most, until its luma is right
_OPENCV, _PILLOW = ((4899, 9617, 1868), 14), ((19595, 38470, 7471), 16)  # weights of red, green and blue, and bits


@cache
def colours() -> np.ndarray:
    """uint8 (256, 3): red, green and blue of each grey; black for 0, as before the first of stacked frames. Read
    only."""
    greys = np.arange(256)
    known = sorted(_SURFACES)
    between = [np.interp(greys, known, [_SURFACES[grey][channel] for grey in known]) for channel in range(3)]
    steps = np.arange(-_NEAR, _NEAR + 1)
    moves = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    moves = moves[np.argsort((moves**2).sum(axis=1), kind="stable")]  # the least change first
    candidates = np.rint(np.stack(between, axis=1)).astype(np.int64)[:, None] + moves
    fits = np.array(((candidates >= 0) & (candidates <= 255)).all(axis=2))
    for weights, bits in (_OPENCV, _PILLOW):
        fits &= (candidates @ np.array(weights) + (1 << (bits - 1))) >> bits == greys[:, None]
    assert fits.any(axis=1).all(), "a grey without a colour"
    table = candidates[greys, fits.argmax(axis=1)].astype(np.uint8)
    table.flags.writeable = False
    return table

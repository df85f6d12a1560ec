"""The rows of a table as CSV text: whole numbers, doubles with all their digits, truths, words.

There are two ways that write the same: :func:`written_slowly` says what, :func:`written` takes the one in C (rows.c)
where it is there. Python needs half a microsecond to find the digits of a double, and a run has thousands.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache

import numpy as np

from . import compiled

_LEAST_POWER, _MOST_POWER = -292, 324  # of ten, that the digits of some double need
_TEXT, _CHARACTER = "U", 4  # kind of a dtype, bytes
# What rows.c calls the kinds, and the most bytes of a value with its comma: of -1.2345678901234567e-308, say.
_KINDS = {"<f8": (0, 25), "<i8": (1, 21), "|b1": (2, 6)}
_OF_TEXT = 3

_library = compiled.load()


def written(columns: Sequence[np.ndarray], library: ctypes.CDLL | None = _library) -> bytes:
    """The rows of ``columns``, all as long, a line each. ``library``: None writes without C."""
    if library is None or not columns:
        return written_slowly(columns)
    table, room = [], 0
    held = [np.ascontiguousarray(column) for column in columns]
    for column in held:
        width = column.dtype.itemsize // _CHARACTER if column.dtype.kind == _TEXT else 0
        kind, most = (_OF_TEXT, width + 1) if width else _KINDS.get(column.dtype.str, (None, 0))
        if kind is None:
            return written_slowly(columns)
        table.append((kind, column.ctypes.data, width))
        room += most
    rows, powers, told = len(held[0]), _powers(), np.array(table, np.int64)
    out = np.empty(rows * room, np.uint8)
    write = library.paddock_write_rows
    write.argtypes = (ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)
    write.restype = ctypes.c_int64
    length = write(told.ctypes.data, len(told), rows, powers.ctypes.data, out.ctypes.data)
    return written_slowly(columns) if length < 0 else out[:length].tobytes()


def written_slowly(columns: Sequence[np.ndarray]) -> bytes:
    """The same by Python alone."""
    # Digits are what takes time here, and columns repeat: one value all the way down, or another column's.
    known: dict[tuple[str, bytes], list[str]] = {}
    texts = []
    for column in columns:
        content = column.tobytes()
        key = column.dtype.str, content
        if key not in known:
            values = column.tolist()
            if column.dtype.kind == "U":
                known[key] = values
            elif values and content == content[: column.itemsize] * len(values):
                known[key] = [repr(values[0])] * len(values)
            else:
                known[key] = list(map(repr, values))
        texts.append(known[key])
    return "".join([",".join(row) + "\n" for row in zip(*texts, strict=True)]).encode()


@cache
def _powers() -> np.ndarray:
    """The powers of ten for rows.c, (N, 2) of uint64: their upper 128 bits, rounded up."""
    found = []
    for exponent in range(_LEAST_POWER, _MOST_POWER + 1):
        power = 10 ** abs(exponent)
        bits = power.bit_length()
        if exponent < 0:
            upper = -(-(1 << (127 + bits)) // power)
        else:
            upper = -(-power >> (bits - 128)) if bits > 128 else power << (128 - bits)
        found.append(divmod(upper, 1 << 64))
    return np.array(found, np.uint64)

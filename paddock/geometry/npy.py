"""The community's track file: float64 (N, 6) = centre x, y | inner x, y | outer x, y in metres. No Django."""

from __future__ import annotations

import io

import numpy as np

from paddock.errors import UserFault

from .checks import Points
from .track import TrackGeometry

MAX_BYTES = 2 * 1024 * 1024
MAX_ROWS = 20_000
_MAX_SIZE = 1 << 48  # a greater number in a header is no size at all (and Python may refuse to write it down)
_QUOTED = 80  # characters of a stranger's header in a sentence


def read_npy(data: bytes, name: str, *, is_open: bool | None = False) -> TrackGeometry:
    """A track from the bytes of a ``.npy`` file. ``is_open``: whether it is meant to be driven from start to end; None
    for whatever the file holds. Raises UserFault with a ``track_...`` code.
    """
    rows = read_rows(data)
    return TrackGeometry.from_arrays(name, rows[:, 0:2], rows[:, 2:4], rows[:, 4:6], is_open=is_open)


def read_rows(data: bytes) -> Points:
    """The (N, 6) table of a ``.npy`` file. Nothing is unpickled and no memory is taken before sizes are checked.

    Raises UserFault with a ``track_...`` code.
    """
    if len(data) > MAX_BYTES:
        raise UserFault("track_file_too_large", limit_mb=MAX_BYTES // (1024 * 1024))
    if data[:1] == b"\x80":  # a bare pickle
        raise UserFault("track_pickled")
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, fortran_order, dtype = read_header(stream)
    except Exception:  # numpy hands a stranger's header to Python's own parsers, which fail in a dozen ways
        raise UserFault("track_not_npy") from None
    if dtype.hasobject:
        raise UserFault("track_pickled")
    if not all(type(size) is int and size < _MAX_SIZE for size in shape):
        raise UserFault("track_not_npy")
    if dtype.kind not in "fiu" or len(shape) != 2 or shape[1] != 6:
        raise UserFault("track_shape", shape=_quoted(f"{shape} {dtype}"))
    if shape[0] > MAX_ROWS:
        raise UserFault("track_too_large", points=shape[0], limit=MAX_ROWS)
    body = data[stream.tell() :]
    if len(body) != shape[0] * 6 * dtype.itemsize:
        raise UserFault("track_not_npy")
    return np.frombuffer(body, dtype=dtype).reshape(shape, order="F" if fortran_order else "C").astype(np.float64)


def _quoted(text: str) -> str:
    return "".join(filter(str.isprintable, text[:_QUOTED])) + ("..." if len(text) > _QUOTED else "")


def write_npy(track: TrackGeometry) -> bytes:
    """The track as a community file: float64 (N + 1, 6), the first row repeated at the end; (N, 6) of an open one."""
    rows = np.hstack((track.centre, track.inner, track.outer))
    stream = io.BytesIO()
    np.save(stream, rows if track.is_open else np.vstack((rows, rows[:1])), allow_pickle=False)
    return stream.getvalue()

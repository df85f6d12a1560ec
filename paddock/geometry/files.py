"""Reads and writes track files: the community's ``.npy``, or a CSV table of a centre line with widths."""

# ``.npy``: float64 (N, 6) = centre x, y | inner x, y | outer x, y in metres.

import io
import math

import numpy as np

from paddock.errors import UserFault

from .checks import MAX_WIDTH_M, MIN_WIDTH_M, Points
from .csv_table import is_table, read_table
from .track import TrackGeometry

FILES = (".npy", ".csv")  # how their names end
SCALES = (0.001, 1000.0)
MAX_BYTES = 2 * 1024 * 1024
MAX_ROWS = 20_000
_MAX_SIZE = 1 << 48  # the greatest size in a header
_QUOTED = 80  # characters of a header in a sentence


def read_track(
    data: bytes, name: str, *, is_open: bool | None = False, scale: float = 1.0, least_width_m: float = 0.0
) -> TrackGeometry:
    """A track from the bytes of a file. ``scale``: a factor of its metres; ``least_width_m``: the width of narrower
    places and of a centre line without widths; 0 for no change. Raises UserFault with a ``track_...`` code."""
    if not (math.isfinite(scale) and SCALES[0] <= scale <= SCALES[1]):
        raise UserFault("track_scale", least=f"{SCALES[0]:g}", most=f"{SCALES[1]:g}")
    if least_width_m and not MIN_WIDTH_M <= least_width_m <= MAX_WIDTH_M:
        raise UserFault("track_least_width", least=f"{MIN_WIDTH_M:g}", most=f"{MAX_WIDTH_M:g}")
    if len(data) > MAX_BYTES:
        raise UserFault("track_file_too_large", limit_mb=MAX_BYTES // (1024 * 1024))
    if not is_table(data):
        return _built(name, _wide(read_rows(data) * scale, least_width_m), is_open)
    with np.errstate(over="ignore", invalid="ignore"):  # numbers beyond float64 are refused as not finite
        return _from_table(name, data, scale, least_width_m, is_open)


def _from_table(name: str, data: bytes, scale: float, least_width_m: float, is_open: bool | None) -> TrackGeometry:
    table = read_table(data, scale, least_width_m)
    try:
        return _built(name, _wide(table.rows(), least_width_m), is_open)
    except UserFault as fault:
        if fault.code != "track_borders_cross" or not table.has_widths:
            raise
        try:  # a file whose columns of the two widths are exchanged
            return _built(name, _wide(table.exchanged().rows(), least_width_m), is_open)
        except UserFault:
            raise fault from None


def _built(name: str, rows: Points, is_open: bool | None) -> TrackGeometry:
    return TrackGeometry.from_arrays(name, rows[:, 0:2], rows[:, 2:4], rows[:, 4:6], is_open=is_open)


def _wide(rows: Points, least_m: float) -> Points:
    """The rows, with the borders moved apart where the road is narrower."""
    if not least_m:
        return rows
    centre, inner, outer = rows[:, 0:2], rows[:, 2:4], rows[:, 4:6]
    widths = np.linalg.norm(inner - outer, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(widths > 0, np.maximum(1.0, least_m / widths), 1.0)[:, None]
    return np.hstack((centre, centre + (inner - centre) * factor, centre + (outer - centre) * factor))


def read_npy(data: bytes, name: str, *, is_open: bool | None = False, is_known: bool = False) -> TrackGeometry:
    """A track from the bytes of a ``.npy`` file. ``is_open``: whether it must be an open track, None for either;
    ``is_known``: it was read before, and is not checked for crossings again. Raises UserFault with a ``track_...``
    code."""
    rows = read_rows(data)
    lines = rows[:, 0:2], rows[:, 2:4], rows[:, 4:6]
    return TrackGeometry.from_arrays(name, *lines, is_open=is_open, is_known=is_known)


def read_rows(data: bytes) -> Points:
    """The (N, 6) table of a ``.npy`` file, without unpickling and checked before memory is taken. Raises UserFault with
    a ``track_...`` code."""
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
    except Exception:  # numpy's parsers of a stranger's header raise a dozen classes
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

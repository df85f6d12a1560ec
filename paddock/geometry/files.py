"""A track from a file: the community's ``.npy``, or a CSV table of a centre line with widths. No Django."""

from __future__ import annotations

import math

import numpy as np

from paddock.errors import UserFault

from .checks import MAX_WIDTH_M, MIN_WIDTH_M, Points
from .csv_table import is_table, read_table
from .npy import MAX_BYTES, read_rows
from .track import TrackGeometry

FILES = (".npy", ".csv")  # how their names end
SCALES = (0.001, 1000.0)


def read_track(
    data: bytes, name: str, *, is_open: bool | None = False, scale: float = 1.0, least_width_m: float = 0.0
) -> TrackGeometry:
    """A track from the bytes of a file. ``scale``: what its metres are multiplied by; ``least_width_m``: narrower
    places become so wide, and a centre line without widths everywhere; 0 leaves them as they are.

    Raises UserFault with a ``track_...`` code.
    """
    if not (math.isfinite(scale) and SCALES[0] <= scale <= SCALES[1]):
        raise UserFault("track_scale", least=f"{SCALES[0]:g}", most=f"{SCALES[1]:g}")
    if least_width_m and not MIN_WIDTH_M <= least_width_m <= MAX_WIDTH_M:
        raise UserFault("track_least_width", least=f"{MIN_WIDTH_M:g}", most=f"{MAX_WIDTH_M:g}")
    if len(data) > MAX_BYTES:
        raise UserFault("track_file_too_large", limit_mb=MAX_BYTES // (1024 * 1024))
    if not is_table(data):
        return _built(name, _wide(read_rows(data) * scale, least_width_m), is_open)
    with np.errstate(over="ignore", invalid="ignore"):  # what is beyond float64 is refused as not finite
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
    """The rows with the borders moved apart where the road is narrower."""
    if not least_m:
        return rows
    centre, inner, outer = rows[:, 0:2], rows[:, 2:4], rows[:, 4:6]
    widths = np.linalg.norm(inner - outer, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(widths > 0, np.maximum(1.0, least_m / widths), 1.0)[:, None]
    return np.hstack((centre, centre + (inner - centre) * factor, centre + (outer - centre) * factor))

"""Reads centre lines from CSV, as F1TENTH and the TUM racetrack database write them."""

# Columns ``x_m, y_m, w_tr_right_m, w_tr_left_m``, with a heading (also as a comment) or without. Six columns without
# such a heading are those of the community's ``.npy``.

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from paddock.errors import UserFault

from .checks import MAX_COORDINATE_M, MAX_WAYPOINTS, Points

MAX_ROWS = 100_000
MAX_LINES = 2 * MAX_ROWS  # with comments and empty lines
_X = ("x_m", "x", "x_ref_m", "center_x", "centre_x")
_Y = ("y_m", "y", "y_ref_m", "center_y", "centre_y")
_RIGHT = ("w_tr_right_m", "w_right", "width_right_m", "width_right", "w_right_m", "w_tr_right")
_LEFT = ("w_tr_left_m", "w_left", "width_left_m", "width_left", "w_left_m", "w_tr_left")
_SHOWN = 60
_WIDE = 0.9  # the greatest share of a bend's radius for the inside of the road


@dataclass(frozen=True)
class CentreLine:
    """A centre line in metres with the widths to its right and its left, or rows with the borders themselves."""

    centre: Points
    right: Points | None = None
    left: Points | None = None
    borders: Points | None = None

    @property
    def has_widths(self) -> bool:
        return self.borders is None

    def exchanged(self) -> CentreLine:
        return replace(self, right=self.left, left=self.right)

    def rows(self) -> Points:
        """Centre, inner and outer border: (N, 6)."""
        if self.borders is not None:
            return np.hstack((self.centre, self.borders))
        assert self.right is not None and self.left is not None
        ends = self.centre[-1] - self.centre[0]
        steps = np.linalg.norm(np.diff(self.centre, axis=0), axis=1)
        is_loop = float(np.hypot(*ends)) <= 1.5 * float(steps.max(initial=0.0))
        after = np.roll(self.centre, -1, axis=0)
        before = np.roll(self.centre, 1, axis=0)
        if not is_loop:
            after[-1], before[0] = self.centre[-1], self.centre[0]
        along = after - before
        lengths = np.linalg.norm(along, axis=1)
        lengths[lengths == 0.0] = 1.0
        normal = np.column_stack((-along[:, 1], along[:, 0])) / lengths[:, None]
        bend = _curvature(before, self.centre, after)
        left = np.where(bend > 0, np.minimum(self.left, _WIDE / np.maximum(bend, 1e-9)), self.left)
        right = np.where(bend < 0, np.minimum(self.right, _WIDE / np.maximum(-bend, 1e-9)), self.right)
        lines = self.centre + normal * left[:, None], self.centre - normal * right[:, None]
        return np.hstack((self.centre, *lines))


def is_table(data: bytes) -> bool:
    """Whether the bytes are text with a line of at least two numbers."""
    if data[:1] in (b"\x93", b"\x80"):
        return False
    try:
        lines = _lines(data)
    except UnicodeDecodeError:
        return False
    return any(len(_numbers(line)) >= 2 for line in lines[:MAX_LINES] if not line.startswith("#"))


def read_table(data: bytes, scale: float, least_width_m: float) -> CentreLine:
    """The centre line of a table, in metres times ``scale``. Raises UserFault("track_csv_...")."""
    heading: list[str] = []
    rows: list[list[float]] = []
    lines = _lines(data)
    if len(lines) > MAX_LINES:
        raise UserFault("track_too_large", points=len(lines), limit=MAX_ROWS)
    for number, line in enumerate(lines, start=1):
        cells = _cells(line.lstrip("# "))
        if not any(cells):
            continue
        if line.startswith("#") or (not rows and not _numbers(line)):
            heading = [cell.lower() for cell in cells] if not rows and len(cells) > 1 else heading
            continue
        values = _numbers(line)
        if len(values) != len(cells) or (rows and len(values) != len(rows[0])):
            raise UserFault("track_csv_row", line=number, row=line[:_SHOWN])
        rows.append(values)
        if len(rows) > MAX_ROWS:
            raise UserFault("track_too_large", points=len(rows), limit=MAX_ROWS)
    table = np.array(rows, dtype=np.float64)
    bad = ~np.isfinite(table).all(axis=1)
    if bad.any():
        raise UserFault("track_not_finite", row=int(np.argmax(bad)))
    return _centre_line(table, heading, scale, least_width_m)


def _centre_line(table: Points, heading: list[str], scale: float, least_width_m: float) -> CentreLine:
    columns = table.shape[1]
    named = {name: at for at, name in enumerate(heading)} if len(heading) == columns else {}
    x, y, right, left = (_column(named, names) for names in (_X, _Y, _RIGHT, _LEFT))
    if x is None or y is None:
        if (named and any(name in named for name in (*_X, *_Y, *_RIGHT, *_LEFT))) or columns not in (2, 4, 6):
            raise UserFault("track_csv_columns", columns=", ".join(heading)[:_SHOWN] or columns)
        x, y = 0, 1
        right, left = (2, 3) if columns == 4 else (None, None)
    if len(table) > MAX_WAYPOINTS:
        table = table[np.unique(np.linspace(0, len(table) - 1, MAX_WAYPOINTS).astype(int))]
    centre = table[:, [x, y]] * scale
    if len(centre) and float(np.abs(centre).max()) > MAX_COORDINATE_M:
        centre = centre - (centre.min(axis=0) + centre.max(axis=0)) / 2.0  # many maps are far from their origin
    if columns == 6 and right is None and left is None and x == 0 and y == 1:
        return CentreLine(centre, borders=table[:, 2:6] * scale - np.tile(table[:, :2] * scale - centre, 2))
    if right is None or left is None:
        if not least_width_m:
            raise UserFault("track_csv_widths")
        half = np.full(len(centre), least_width_m / 2.0)
        return CentreLine(centre, half, half)
    widths = table[:, [right, left]] * scale
    if float(widths.min()) < 0.0:
        raise UserFault("track_csv_negative", row=int(widths.min(axis=1).argmin()))
    more = np.maximum(0.0, least_width_m - widths.sum(axis=1)) / 2.0  # on both sides of a narrow road
    return CentreLine(centre, widths[:, 0] + more, widths[:, 1] + more)


def _curvature(before: Points, at: Points, after: Points) -> Points:
    """1 / radius of the circle through three points, positive for a bend to the left."""
    a, b, c = at - before, after - at, after - before
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    product = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1) * np.linalg.norm(c, axis=1)
    return np.where(product > 0, 2.0 * area / np.maximum(product, 1e-12), 0.0)


def _column(named: dict[str, int], names: tuple[str, ...]) -> int | None:
    return next((named[name] for name in names if name in named), None)


def _lines(data: bytes) -> list[str]:
    text = data.decode("utf-8-sig")
    if "\0" in text:
        raise UnicodeDecodeError("utf-8", data[:1], 0, 1, "a null character")
    return [line.strip() for line in text.splitlines()]


def _cells(line: str) -> list[str]:
    separator = next((mark for mark in (";", ",", "\t") if mark in line), None)
    cells = [cell.strip() for cell in (line.split(separator) if separator else line.split())]
    return cells[:-1] if separator and len(cells) > 1 and not cells[-1] else cells


def _numbers(line: str) -> list[float]:
    """The numbers of a line, or none. Between semicolons a comma is a decimal point."""
    cells, has_semicolons = _cells(line), ";" in line
    try:
        return [float(cell.replace(",", ".") if has_semicolons else cell) for cell in cells]
    except ValueError:
        return []

"""The ONNX operator Resize for pictures of fixed sizes, one axis after the other."""

# Meaning: onnx/docs/Operators.md, Resize. Places in the picture are computed in float32, as the runtime does.

import numpy as np

from .model import Node

_F = np.float32
NEAREST, LINEAR = "nearest", "linear"


def resize(
    node: Node,
    x: np.ndarray,
    roi: np.ndarray | None = None,
    scales: np.ndarray | None = None,
    sizes: np.ndarray | None = None,
) -> np.ndarray:
    result = x
    missed: dict[int, np.ndarray] = {}
    for axis, places in _turns(node, x.shape, roi, scales, sizes).items():
        outside = (places < 0) | (places > x.shape[axis] - 1)
        if _is_cropped(node) and outside.any():
            missed[axis] = outside
        result = _along(node, result, axis, places)
    for axis, away in missed.items():
        result = np.moveaxis(result, axis, 0).copy()
        result[away] = node.real("extrapolation_value", 0.0)
        result = np.moveaxis(result, 0, axis)
    return result


def matrices(
    node: Node,
    shape: tuple[int, ...],
    roi: np.ndarray | None = None,
    scales: np.ndarray | None = None,
    sizes: np.ndarray | None = None,
) -> dict[int, np.ndarray] | None:
    """For each axis that changes, the share of each old line in each new one: float64 ``[new, old]``. None where the
    new picture reaches beyond the old one."""
    found = {}
    for axis, places in _turns(node, shape, roi, scales, sizes).items():
        if _is_cropped(node) and ((places < 0) | (places > shape[axis] - 1)).any():
            return None
        found[axis] = _along(node, np.eye(shape[axis]), 0, places)
    return found


def _is_cropped(node: Node) -> bool:
    return node.text("coordinate_transformation_mode", "half_pixel") == "tf_crop_and_resize"


def _turns(
    node: Node,
    shape: tuple[int, ...],
    roi: np.ndarray | None,
    scales: np.ndarray | None,
    sizes: np.ndarray | None,
) -> dict[int, np.ndarray]:
    """For each axis that changes, the place of each new line in the old picture."""
    axes = [axis % len(shape) for axis in node.wholes("axes") or range(len(shape))]
    sides = _sides(shape, axes, scales, sizes, node.text("keep_aspect_ratio_policy", "stretch"))
    starts = dict.fromkeys(axes, (_F(0), _F(1)))
    if roi is not None and roi.size == 2 * len(axes):
        starts = {axis: (_F(roi[place]), _F(roi[place + len(axes)])) for place, axis in enumerate(axes)}
    return {
        axis: _places(node, shape[axis], length, scale, starts[axis])
        for axis, (length, scale) in sides.items()
        if length != shape[axis] or scale != 1 or _is_cropped(node)
    }


def _sides(
    shape: tuple[int, ...], axes: list[int], scales: np.ndarray | None, sizes: np.ndarray | None, policy: str
) -> dict[int, tuple[int, np.float32]]:
    """For each axis its new length and the scale."""
    if sizes is None or not sizes.size:
        given = {axis: _F(scale) for axis, scale in zip(axes, [] if scales is None else scales.tolist(), strict=True)}
        return {axis: (int(np.floor(_F(shape[axis]) * scale)), scale) for axis, scale in given.items()}
    wanted = dict(zip(axes, sizes.tolist(), strict=True))
    if policy == "stretch":
        return {axis: (length, _F(length) / _F(shape[axis])) for axis, length in wanted.items()}
    choose = min if policy == "not_larger" else max
    scale = choose(_F(length) / _F(shape[axis]) for axis, length in wanted.items())
    return {axis: (int(np.floor(scale * _F(shape[axis]) + _F(0.5))), scale) for axis in wanted}


def _places(node: Node, before: int, after: int, scale: np.float32, crop: tuple[np.float32, np.float32]) -> np.ndarray:
    """The place of each new line in the old picture, float32[after]."""
    lines, mode = np.arange(after, dtype=_F), node.text("coordinate_transformation_mode", "half_pixel")
    if mode == "asymmetric":
        return lines / scale
    if mode == "align_corners":
        return np.zeros(1, _F) if after == 1 else lines * _F(before - 1) / _F(after - 1)
    if mode == "pytorch_half_pixel" and after == 1:
        return np.zeros(1, _F)
    if mode == "tf_crop_and_resize":
        start, end = crop
        if after == 1:
            return np.full(1, _F(0.5) * (start + end) * _F(before - 1))
        return start * _F(before - 1) + lines * (end - start) * _F(before - 1) / _F(after - 1)
    places = (lines + _F(0.5)) / scale - _F(0.5)
    if mode == "half_pixel_symmetric":
        adjusted = _F(after) / (scale * _F(before))
        places = _F(before) / _F(2) * (_F(1) - adjusted) + places
    return places


def _along(node: Node, x: np.ndarray, axis: int, places: np.ndarray) -> np.ndarray:
    mode, last = node.text("mode", NEAREST), x.shape[axis] - 1
    if mode == NEAREST:
        return np.take(x, np.clip(_nearest(node, places), 0, last), axis)
    if mode == LINEAR:
        places = np.clip(places, _F(0), _F(last)).astype(np.float64)
        low = np.minimum(places.astype(np.int64), last)
        high = np.minimum(low + 1, last)
        share = places - low
        taps = [(low, 1.0 - share), (high, share)]
    else:
        taps = _cubic(node, places, last)
    shape = [-1 if number == axis else 1 for number in range(x.ndim)]
    return sum(np.take(x, lines, axis) * weights.reshape(shape) for lines, weights in taps)


def _nearest(node: Node, places: np.ndarray) -> np.ndarray:
    mode = node.text("nearest_mode", "round_prefer_floor")
    if mode == "floor":
        return np.floor(places).astype(np.int64)
    if mode == "ceil":
        return np.ceil(places).astype(np.int64)
    if mode == "round_prefer_ceil":
        return np.floor(places + _F(0.5)).astype(np.int64)
    return np.ceil(places - _F(0.5)).astype(np.int64)


def _cubic(node: Node, places: np.ndarray, last: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Four taps of Keys' kernel."""
    a = node.real("cubic_coeff_a", -0.75)
    places = places.astype(np.float64)
    first = np.floor(places)
    share = places - first
    weights = np.stack(
        [
            ((a * (share + 1) - 5 * a) * (share + 1) + 8 * a) * (share + 1) - 4 * a,
            ((a + 2) * share - (a + 3)) * share * share + 1,
            ((a + 2) * (1 - share) - (a + 3)) * (1 - share) * (1 - share) + 1,
            ((a * (2 - share) - 5 * a) * (2 - share) + 8 * a) * (2 - share) - 4 * a,
        ]
    )
    lines = first.astype(np.int64) + np.arange(-1, 3)[:, None]
    if node.whole("exclude_outside", 0):
        weights = np.where((lines < 0) | (lines > last), 0.0, weights)
        weights = weights / weights.sum(axis=0)
    lines = np.clip(lines, 0, last)
    return [(lines[tap], weights[tap]) for tap in range(4)]

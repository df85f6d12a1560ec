"""Tracks on pages: their maps and lengths."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from django import template
from django.core.cache import cache
from django.utils.html import format_html
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import gettext as _

from tracks.drawing import maps
from tracks.drawing.maps import Trajectory, draw_svg
from tracks.models import Track
from tracks.selectors import TrackFigure

register = template.Library()


@register.filter
def dot_radius(size: tuple[float, float]) -> str:
    """Radius of a car's dot on a map of this size."""
    return f"{0.018 * max(size):.2f}"


# Maps are kept by all that they are made of: the shape, and the program that draws.
_DRAWN_BY = hashlib.sha256(Path(maps.__file__).read_bytes()).hexdigest()
_KEPT_S = 7 * 24 * 3600
_MOST_MAPS = 256  # of one process
_maps: dict[str, str] = {}


def _plain_map(track: Track, direction: str, title: str) -> str:
    """Drawn once for all processes."""
    parts = _DRAWN_BY, track.fingerprint, direction, title
    key = f"map:{hashlib.sha256(repr(parts).encode()).hexdigest()}"
    if key not in _maps:
        found = cache.get(key)
        if found is None:
            found = draw_svg(track.geometry.in_direction(direction), title=title)
            cache.set(key, found, _KEPT_S)
        _maps[key] = found
        for oldest in list(_maps)[:-_MOST_MAPS]:
            _maps.pop(oldest, None)
    return _maps[key]


@register.filter
def track_length(track: Track) -> str:
    return f"{track.length_m:.2f} m" if track.has_shape else _("length unknown")


@register.filter
def way(track: Track, direction: str) -> str:
    return track.way(direction)


@register.filter
def figure_of(track: Track, figure: TrackFigure) -> str:
    """A figure of a track for reading; ``""`` for none."""
    return figure.shown(track)


@register.simple_tag
def track_map(track: Track, direction: str = "", lines: Iterable[Trajectory] = (), title: str = "") -> SafeString:
    """The track's map as inline SVG, driven in ``direction`` (default: the file's own), with driven ``lines``."""
    direction, title = direction or track.direction, title or track.name
    if not track.has_shape:
        return format_html('<p class="muted">{}</p>', _("No map available for this track."))
    if lines:
        drawing = draw_svg(track.geometry.in_direction(direction), lines=tuple(lines), title=title)
    else:
        drawing = _plain_map(track, direction, title)
    return mark_safe(drawing)  # the only text in it is the title, which draw_svg escapes

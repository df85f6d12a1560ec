"""Tracks on pages: their maps and lengths."""

from collections.abc import Iterable
from functools import lru_cache

from django import template
from django.utils.html import format_html
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import gettext as _

from paddock.geometry.track import TrackGeometry
from tracks.drawing.maps import Trajectory, draw_svg
from tracks.models import Track
from tracks.selectors import TrackFigure

register = template.Library()


@register.filter
def dot_radius(size: tuple[float, float]) -> str:
    """Radius of a car's dot on a map of this size."""
    return f"{0.018 * max(size):.2f}"


@lru_cache(maxsize=256)
def _plain_map(track: TrackGeometry, direction: str, title: str) -> str:
    return draw_svg(track.in_direction(direction), title=title)


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
        drawing = _plain_map(track.geometry, direction, title)
    return mark_safe(drawing)  # the only text in it is the title, which draw_svg escapes

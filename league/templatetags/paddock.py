"""What every page needs to show: times as m:ss.mmm, moments, track maps, the reader's theme."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Any, Literal

from django import template
from django.forms.boundfield import BoundField
from django.forms.widgets import ChoiceWidget
from django.http import HttpRequest
from django.utils import timezone
from django.utils.html import format_html
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import gettext as _

from accounts import countries
from paddock.geometry.track import TrackGeometry
from races import facts
from races.replay import LAP_COLOURS
from tracks.drawing import DrivenLine, draw_svg
from tracks.models import Track

register = template.Library()

THEMES = ("dark", "light")
SECTIONS = (
    ("/seasons/", "league"),
    ("/hall-of-fame/", "league"),
    ("/races/", "races"),
    ("/community/", "races"),
    ("/join/", "races"),
    ("/evaluations/", "races"),
    ("/tracks/", "tracks"),
    ("/models/", "garage"),
    ("/vehicles/", "garage"),
    ("/train/", "train"),
    ("/learn/", "learn"),
    ("/about/", "about"),
)


@register.filter
def theme(request: HttpRequest | str) -> str:
    """The theme that the reader chose: ``dark``, ``light``, or ``""`` to follow the system."""
    chosen = getattr(request, "COOKIES", {}).get("theme", "")
    return chosen if chosen in THEMES else ""


@register.filter
def section(request: HttpRequest | str) -> str:
    """Which entry of the site's navigation a page belongs to."""
    path = getattr(request, "path", "")
    return next((name for prefix, name in SECTIONS if path.startswith(prefix)), "")


@register.filter
def lap_time(milliseconds: int | Literal[""] | None) -> str:
    """A lap time as ``m:ss.mmm``; a dash for none."""
    if milliseconds is None or milliseconds == "":
        return "–"
    return facts.clock(round(milliseconds))


@register.filter
def gap(milliseconds: int | Literal[""] | None) -> str:
    """A difference as ``+s.mmm`` (``+m:ss.mmm`` from a minute on); nothing for none."""
    if milliseconds is None or milliseconds == "":
        return ""
    return facts.gap(round(milliseconds))


@register.filter
def sector_time(milliseconds: int | None) -> str:
    """A sector's time as ``s.mmm`` (``m:ss.mmm`` from a minute on)."""
    if milliseconds is None or milliseconds >= 60_000:
        return lap_time(milliseconds)
    return f"{milliseconds // 1000}.{milliseconds % 1000:03d}"


@register.filter
def seconds(milliseconds: int | None) -> str:
    """Milliseconds as seconds without needless zeros: 3000 is ``3``, 2500 is ``2.5``."""
    return "" if milliseconds is None else f"{milliseconds / 1000:g}"


@register.filter
def country_name(code: str) -> str:
    """The country's name in the reader's language; the code itself when it is not known."""
    return countries.country_name(code)


@register.filter
def thousands(number: int | None) -> str:
    """A large count in a few characters: 5860k as ``5.86 M``."""
    if number is None:
        return "–"
    for size, unit in ((1_000_000, "M"), (1_000, "k")):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return str(number)


@register.filter
def dot_if_zero(count: int | None) -> str:
    """A count in a dense table: zero is a dot."""
    return str(count) if count else "·"


@register.filter
def translated(text: str) -> str:
    """A text of our own that was stored in English (the catalogue's descriptions), in the reader's language."""
    return _(text) if text else ""


@register.filter
def item(mapping: dict, key: Any) -> Any:
    """``mapping[key]``, or nothing."""
    return mapping.get(key) if mapping else None


@register.filter
def at(values: Sequence, index: int) -> Any:
    """``values[index]``, or nothing."""
    return values[index] if values and index < len(values) else None


@register.filter
def ceil(number: float) -> int:
    """The next whole number."""
    return math.ceil(number)


@register.filter
def plain(number: float) -> str:
    """A number for a drawing: never with the reader's decimal comma."""
    return f"{number:g}"


@register.filter
def dot_radius(size: tuple[float, float]) -> str:
    """Radius of a car's dot on a map of this size."""
    return f"{0.018 * max(size):.2f}"


@register.filter
def lap_colour(number: int) -> int:
    """Which of the lap colours lap ``number`` (from 1) has."""
    return (number - 1) % LAP_COLOURS


@register.filter
def overall_percent(progress: dict) -> int:
    """How much of a whole run is driven, from the progress within its lap."""
    if not progress or not progress.get("laps"):
        return 0
    driven = 100 * (progress["lap"] - 1) + min(100.0, max(0.0, progress["percent"]))
    return round(driven / progress["laps"])


@register.filter
def sector_word(colour: str | None) -> str:
    """What a sector's colour means, for who does not see it."""
    words = {"purple": _("fastest of all"), "green": _("own best"), "yellow": _("slower")}
    return words.get(colour or "", "")


@register.simple_tag
def moment(when: datetime | None) -> SafeString | str:
    """A moment in the site's time zone; the page's script turns it into the reader's."""
    if when is None:
        return "–"
    local = timezone.localtime(when)
    return format_html(
        '<time datetime="{}" data-local>{}</time>', when.isoformat(), local.strftime("%Y-%m-%d %H:%M %Z")
    )


def time_left(left: timedelta) -> str:
    """A duration in its two largest units: ``9 d 14 h``."""
    total = max(0, int(left.total_seconds()))
    days, hours, minutes, rest = total // 86400, total // 3600 % 24, total // 60 % 60, total % 60
    if days:
        return f"{_('%s d') % days} {_('%s h') % hours}"
    if hours:
        return f"{_('%s h') % hours} {_('%s min') % minutes}"
    return f"{_('%s min') % minutes} {_('%s s') % rest}"


@register.simple_tag
def countdown(when: datetime, over: str = "") -> SafeString:
    """The time left until ``when``; the page's script counts it down and ends with ``over``."""
    return format_html(
        '<time datetime="{}" data-countdown data-d="{}" data-h="{}" data-m="{}" data-s="{}" data-over="{}">{}</time>',
        when.isoformat(),
        _("%s d"),
        _("%s h"),
        _("%s min"),
        _("%s s"),
        over,
        time_left(when - timezone.now()),
    )


@register.simple_tag
def ago(when: datetime | None) -> SafeString | str:
    """How long ago, in its largest unit, with the moment itself on hovering."""
    if when is None:
        return "–"
    total = max(0, int((timezone.now() - when).total_seconds()))
    for size, form in ((86400, _("%s d ago")), (3600, _("%s h ago")), (60, _("%s min ago"))):
        if total >= size:
            text = form % (total // size)
            break
    else:
        text = _("just now")
    local = timezone.localtime(when)
    return format_html(
        '<time datetime="{}" title="{}">{}</time>', when.isoformat(), local.strftime("%Y-%m-%d %H:%M %Z"), text
    )


@lru_cache(maxsize=256)
def _plain_map(track: TrackGeometry, direction: str, title: str) -> str:
    return draw_svg(track.in_direction(direction), title=title)


@register.filter
def track_length(track: Track) -> str:
    """The length of a track for reading, or that it is not known."""
    return f"{track.length_m:.2f} m" if track.has_shape else _("length unknown")


@register.simple_tag
def track_map(track: Track, direction: str = "", lines: Iterable[DrivenLine] = (), title: str = "") -> SafeString:
    """The track's map as inline SVG, driven in ``direction`` (default: the file's own), with driven ``lines``."""
    direction, title = direction or track.direction, title or track.name
    if not track.has_shape:
        return format_html('<p class="muted">{}</p>', _("No map: the shape of this track is not known here."))
    if lines:
        drawing = draw_svg(track.geometry.in_direction(direction), lines=tuple(lines), title=title)
    else:
        drawing = _plain_map(track.geometry, direction, title)
    return mark_safe(drawing)  # the only text in it is the title, which draw_svg escapes


@register.filter
def target(field: BoundField) -> str:
    """The id of what a link to a form's field leads to: its control, or the first of several."""
    if field.id_for_label:
        return field.id_for_label
    return f"{field.auto_id}_0" if isinstance(field.field.widget, ChoiceWidget) else field.auto_id

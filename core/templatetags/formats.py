"""What every page needs to show: times as m:ss.mmm, moments, counts."""

import math
from collections.abc import Sequence
from datetime import date, datetime, timedelta
from typing import Any, Literal

from django import template
from django.forms.boundfield import BoundField
from django.forms.widgets import ChoiceWidget
from django.utils import timezone
from django.utils.dateformat import format as date_format
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.utils.translation import pgettext

from core import times
from core.validators import is_right_to_left

register = template.Library()
OLD_S = 30 * 86400  # from this age on a date is shown instead of a number of days


@register.filter
def bdi(value: object) -> object:
    """A user's text; with right-to-left letters in a ``<bdi>``. Not for attributes and titles."""
    if isinstance(value, SafeString) or value is None or not is_right_to_left(text := str(value)):
        return value
    return format_html("<bdi>{}</bdi>", text)


@register.filter
def lap_time(milliseconds: int | Literal[""] | None) -> str:
    """A lap time as ``m:ss.mmm``; a dash for none."""
    if milliseconds is None or milliseconds == "":
        return "–"
    return times.clock(round(milliseconds))


@register.filter
def gap(milliseconds: int | Literal[""] | None) -> str:
    """A difference as ``+s.mmm`` (``+m:ss.mmm`` from a minute on); nothing for none."""
    if milliseconds is None or milliseconds == "":
        return ""
    return times.gap(round(milliseconds))


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
    return mapping.get(key) if mapping else None


@register.filter
def at(values: Sequence, index: int) -> Any:
    return values[index] if values and index < len(values) else None


@register.filter
def ceil(number: float) -> int:
    return math.ceil(number)


@register.filter
def plain(number: float) -> str:
    """A number for a drawing: never with the reader's decimal comma."""
    return f"{number:g}"


@register.filter
def day(when: date | datetime | None) -> str:
    return "–" if when is None else times.written_day(when)


@register.filter
def written(when: datetime) -> str:
    """A moment as plain text, for options of a list."""
    return times.written(when)


@register.filter
def month(when: date | datetime) -> str:
    local = timezone.localtime(when) if isinstance(when, datetime) else when
    return date_format(local, pgettext("format of a month", "F Y"))


@register.simple_tag
def moment(when: datetime | None) -> SafeString | str:
    """A moment in the reader's time zone; on a first visit the page's script turns the site's into it."""
    if when is None:
        return "–"
    return format_html('<time datetime="{}" data-local>{}</time>', when.isoformat(), times.written(when))


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


def shown_age(when: datetime) -> tuple[int, int, int]:
    """What :func:`ago` shows depends on it: the seconds of the largest unit, how many of these, and the year it is."""
    total = max(0, int((timezone.now() - when).total_seconds()))
    size = next((size for size in (86400, 3600, 60) if total >= size), 60)
    return size, total // size, timezone.localdate().year


@register.simple_tag
def ago(when: datetime | None) -> SafeString | str:
    """How long ago, in its largest unit, the day itself from a month on; with the moment on hovering."""
    if when is None:
        return "–"
    size, count, _year = shown_age(when)
    if size * count >= OLD_S:
        text = day(when)
    else:
        forms = {86400: _("%s d ago"), 3600: _("%s h ago"), 60: _("%s min ago")}
        text = forms[size] % count if count else _("just now")
    return format_html('<time datetime="{}" title="{}">{}</time>', when.isoformat(), times.written(when), text)


@register.filter
def target(field: BoundField) -> str:
    """The id of what a link to a form's field leads to: its control, or the first of several."""
    if field.id_for_label:
        return field.id_for_label
    return f"{field.auto_id}_0" if isinstance(field.field.widget, ChoiceWidget) else field.auto_id

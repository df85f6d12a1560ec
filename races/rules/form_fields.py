"""Form fields of a race: seconds, moments, boxes."""

from collections.abc import Mapping
from datetime import datetime
from decimal import Decimal, InvalidOperation
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from paddock.rules.race import BOX_FRACTIONS, MAX_BOXES

from ..errors import problem
from ..models import Lane, Race
from ..models.layout import FixedBox


class SecondsField(forms.DecimalField):
    """Seconds on the page, whole milliseconds in the database."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(decimal_places=3, **kwargs)

    def prepare_value(self, value: Any) -> Any:
        return f"{value / 1000:g}" if isinstance(value, int) else value

    def clean(self, value: Any) -> int | None:
        if self.disabled:
            return value
        seconds: Decimal | None = super().clean(value)
        return None if seconds is None else int(seconds * 1000)

    def has_changed(self, initial: Any, data: Any) -> bool:
        shown = self.prepare_value(initial)
        return super().has_changed(None if shown is None else self.to_python(shown), data)


class ResetsField(forms.IntegerField):
    """How many resets a run may have; an empty field is no limit, which is stored as the greatest number."""

    def __init__(self, *, unlimited: int, **kwargs: Any) -> None:
        super().__init__(min_value=0, max_value=unlimited, required=False, **kwargs)
        self.unlimited = unlimited
        self.widget.attrs["placeholder"] = _("unlimited")

    def prepare_value(self, value: Any) -> Any:
        return "" if str(value) == str(self.unlimited) else value

    def clean(self, value: Any) -> int:
        """The number as typed, ``unlimited`` for none."""
        resets: int | None = super().clean(value)
        return self.unlimited if resets is None else resets

    def has_changed(self, initial: Any, data: Any) -> bool:
        return super().has_changed(self.prepare_value(initial), data)


class PlainNumberField(forms.FloatField):
    def prepare_value(self, value: Any) -> Any:
        return f"{value:g}" if isinstance(value, int | float) else value


class MomentInput(forms.DateTimeInput):
    """A date and time; the page's script shows it in the reader's time zone."""

    input_type = "datetime-local"

    def format_value(self, value: Any) -> str | None:
        return value.strftime("%Y-%m-%dT%H:%M") if isinstance(value, datetime) else value


class MomentField(forms.DateTimeField):
    """A moment, typed in the time zone that the form names."""

    widget = MomentInput

    def to_python(self, value: Any) -> datetime | None:
        """The date and time as typed, still without a time zone; the form adds it."""
        if value in self.empty_values:
            return None
        if isinstance(value, datetime):
            return value
        for form in ("%Y-%m-%dT%H:%M", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%d %H:%M"):
            try:
                return datetime.strptime(value, form)
            except (ValueError, TypeError):
                continue
        raise forms.ValidationError(self.error_messages["invalid"], code="invalid")


class BoxesInput(forms.Widget):
    """A row for each box: percentage of the lap and lane. Rows without a percentage are no boxes."""

    template_name = "races/rules/boxes.html"
    use_fieldset = True

    def id_for_label(self, id_: str) -> str:
        """None: each row has its own label."""
        return ""

    def get_context(self, name: str, value: Any, attrs: dict[str, object] | None) -> dict[str, object]:
        """As Django's, with ``rows`` of (percent as typed, lane)."""
        context = super().get_context(name, None, attrs)
        typed = [_typed(box) for box in value or ()]
        rows = [*typed, *[("", Lane.values[number % 2]) for number in range(len(typed), MAX_BOXES)]]
        context["widget"] |= {"rows": rows, "lanes": Lane.choices, "used": len(typed)}
        context["widget"] |= {"least": f"{100 * BOX_FRACTIONS[0]:g}", "most": f"{100 * BOX_FRACTIONS[1]:g}"}
        return context

    def value_from_datadict(self, data: Mapping[str, Any], files: Any, name: str) -> list[tuple[str, str]]:
        """The rows as typed, those without a percentage left out."""
        rows = [
            (str(data.get(f"{name}-{number}-percent", "")).strip(), str(data.get(f"{name}-{number}-lane", "")))
            for number in range(1, MAX_BOXES + 1)
        ]
        return [row for row in rows if row[0]]

    def value_omitted_from_data(self, data: Mapping[str, Any], files: Any, name: str) -> bool:
        return not any(f"{name}-{number}-percent" in data for number in range(1, MAX_BOXES + 1))


class BoxesField(forms.Field):
    """Boxes in fixed places, as ``Race.boxes`` holds them."""

    widget = BoxesInput

    def to_python(self, value: Any) -> list[FixedBox]:
        """Rows as typed, as places; places as they are. Raises ValidationError "race_box_percent"."""
        rows = enumerate(value or (), start=1)
        return [_place(number, *box) if isinstance(box, list | tuple) else box for number, box in rows]

    def each(self, value: Any) -> list[FixedBox | None]:
        """As :meth:`to_python`, but None for a row that cannot be read."""
        places: list[FixedBox | None] = []
        for row in value or ():
            try:
                places += self.to_python([row])
            except forms.ValidationError:
                places.append(None)
        return places

    def has_changed(self, initial: Any, data: Any) -> bool:
        try:
            return self.to_python(initial) != self.to_python(data)
        except forms.ValidationError:
            return True


def _place(number: int, percent: str, lane: str) -> FixedBox:
    try:
        share = Decimal(percent.replace(",", ".").rstrip(" %"))
    except InvalidOperation:
        raise problem("race_box_percent", number=number) from None
    if not share.is_finite() or lane not in Lane.values:
        raise problem("race_box_percent", number=number)
    return {"fraction": round(float(share) / 100, 6), "lane": lane}


def _typed(box: Any) -> tuple[str, str]:
    return (f"{100 * box['fraction']:.6g}", box["lane"]) if isinstance(box, dict) else tuple(box)


class BesideField(forms.CharField):
    """The simulated race beside one of real cars, by slug or address. Unknown and forbidden races are refused alike."""

    def prepare_value(self, value: Any) -> Any:
        return value.slug if isinstance(value, Race) else value

    def to_python(self, value: Any) -> Race | None:
        """Raises ValidationError "race_beside"."""
        if value is None or isinstance(value, Race):
            return value
        slug = str(value).split("?")[0].rstrip("/").rpartition("/")[2].strip()
        if not slug:
            return None
        found = Race.objects.filter(slug=slug).first()
        if found is None:
            raise problem("race_beside")
        return found

    def has_changed(self, initial: Any, data: Any) -> bool:
        return (self.prepare_value(initial) or "") != (self.prepare_value(data) or "")

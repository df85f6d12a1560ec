"""Which way round a track is driven, as forms ask for it: of a loop by the clock, of an open track from end to end."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from .models import Direction, Track


class TrackSelect(forms.Select):
    """Tracks; each open one tells the direction that leads from its start to its end (``data-open``)."""

    def create_option(self, name: str, value: Any, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """As Django's."""
        option = super().create_option(name, value, *args, **kwargs)
        track = getattr(value, "instance", None)
        if track is not None and track.is_open:
            option["attrs"]["data-open"] = track.direction
        return option


class WaySelect(forms.Select):
    """Directions; the script of all pages renames them when another track is chosen, and knows all words from here."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.attrs |= {"data-forth": _("from start to end"), "data-back": _("from end to start")}

    def create_option(self, name: str, value: Any, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """As Django's, with the word of a loop (``data-usual``)."""
        option = super().create_option(name, value, *args, **kwargs)
        option["attrs"]["data-usual"] = str(Direction(value).label)
        return option


def say_ways(form: forms.Form) -> None:
    """Let ``direction`` of a form speak of its ``track``, the one that it shows now and whatever is chosen then."""
    track, direction = form.fields["track"], form.fields["direction"]
    assert isinstance(track, forms.ModelChoiceField)
    track.widget = TrackSelect(attrs=track.widget.attrs)
    track.widget.choices = track.choices
    chosen = form["track"].value()
    shown = chosen if isinstance(chosen, Track) else None
    if shown is None and chosen:
        shown = track.queryset.filter(slug=str(chosen), is_open=True).first() if track.queryset is not None else None
    usual = direction.choices  # type: ignore[attr-defined]
    direction.widget = WaySelect(attrs=direction.widget.attrs)
    direction.choices = usual if shown is None else [(way, shown.way(way)) for way in Direction.values]  # type: ignore[attr-defined]

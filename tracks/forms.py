"""The form that imports a track, and the field of a driving direction."""

from collections.abc import Iterator
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from paddock.geometry.files import MAX_BYTES

from .models import Direction, Track, TrackLook
from .selectors import shared_track, shared_tracks


class ImportTrackForm(forms.Form):
    """A track file of the community and what to call it."""

    name = forms.CharField(label=_("Name"), max_length=64)
    file = forms.FileField(
        label=_("Track file"),
        allow_empty_file=True,
        help_text=_(
            "A NumPy file (.npy) with six columns in metres: centre x and y, inner border x and y, outer border x "
            "and y; or a CSV centre line with x_m, y_m, w_tr_right_m, w_tr_left_m. The first point is the finish line."
        ),
        widget=forms.FileInput(attrs={"accept": ".npy,.csv"}),
    )
    scale = forms.FloatField(
        label=_("Scale"), required=False, initial=1, help_text=_("0.1 makes the track a tenth of the size in the file.")
    )
    least_width_m = forms.FloatField(
        label=_("Minimum width (m)"), required=False, help_text=_("Narrower sections are widened.")
    )
    is_open = forms.BooleanField(
        label=_("Open track: driven from start to end"),
        required=False,
        help_text=_("The first point is the start and the last one the finish; each lap begins at the start again."),
    )
    look = forms.ChoiceField(
        label=_("Look"),
        choices=TrackLook.choices,
        initial=TrackLook.OFFICIAL,
        required=False,
        help_text=_("Appearance for cameras: lines, dashes, greys and the wall. Cannot be changed later."),
    )

    def clean_scale(self) -> float:
        """As it is, where none is given."""
        return 1.0 if self.cleaned_data["scale"] is None else self.cleaned_data["scale"]

    def clean_look(self) -> str:
        """The official one where none is named."""
        return self.cleaned_data["look"] or TrackLook.OFFICIAL

    def data_bytes(self) -> bytes:
        """The file's bytes, one more than any track may have at most, so that a huge upload is not read whole."""
        return self.cleaned_data["file"].read(MAX_BYTES + 1)


class _TrackChoices(forms.models.ModelChoiceIterator):
    def __iter__(self) -> Iterator[tuple[Any, Any]]:
        if self.field.empty_label is not None:
            yield "", self.field.empty_label
        yield from map(self.choice, shared_tracks())


class TrackChoiceField(forms.ModelChoiceField):
    """A choice among all tracks that can be driven on, by their addresses."""

    iterator = _TrackChoices

    def __init__(self, **kwargs: Any) -> None:
        tracks = Track.objects.exclude(length_m=None).defer("npy")
        super().__init__(queryset=tracks, to_field_name="slug", **kwargs)


class TrackSelect(forms.Select):
    """Tracks; the option of an open track has the direction from its start to its end in ``data-open``."""

    def create_option(self, name: str, value: Any, *args: Any, **kwargs: Any) -> dict[str, object]:
        option = super().create_option(name, value, *args, **kwargs)
        track = getattr(value, "instance", None)
        if track is not None and track.is_open:
            option["attrs"]["data-open"] = track.direction
        return option


class DirectionSelect(forms.Select):
    """Directions; a script relabels them when another track is selected, with the words in ``data-`` attributes."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.attrs |= {"data-forth": _("from start to end"), "data-back": _("from end to start")}

    def create_option(self, name: str, value: Any, *args: Any, **kwargs: Any) -> dict[str, object]:
        option = super().create_option(name, value, *args, **kwargs)
        option["attrs"]["data-usual"] = str(Direction(value).label)
        return option


def label_directions(form: forms.Form) -> None:
    track, direction = form.fields["track"], form.fields["direction"]
    assert isinstance(track, forms.ModelChoiceField)
    track.widget = TrackSelect(attrs=track.widget.attrs)
    track.widget.choices = track.choices
    chosen = form["track"].value()
    shown = chosen if isinstance(chosen, Track) else None
    if shown is None and chosen:
        named = shared_track(str(chosen))
        shown = named if named is not None and named.is_open else None
    usual = direction.choices  # type: ignore[attr-defined]
    direction.widget = DirectionSelect(attrs=direction.widget.attrs)
    direction.choices = usual if shown is None else [(way, shown.way(way)) for way in Direction.values]  # type: ignore[attr-defined]

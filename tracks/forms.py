"""The form of the track pages."""

from __future__ import annotations

from django import forms
from django.utils.translation import gettext_lazy as _

from paddock.geometry.npy import MAX_BYTES

from .models import TrackLook


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
        label=_("Scale"), required=False, initial=1, help_text=_("0.1 makes a tenth of the file's metres.")
    )
    least_width_m = forms.FloatField(
        label=_("Least width (m)"), required=False, help_text=_("Optional. Narrower places are widened to it.")
    )
    is_open = forms.BooleanField(
        label=_("This track is open: it is driven from start to end"),
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

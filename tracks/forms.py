"""The form of the track pages, and how any form shows what a service refused."""

from __future__ import annotations

from django import forms
from django.utils.translation import gettext, gettext_noop
from django.utils.translation import gettext_lazy as _

from faults import PaddockError

from .models import Look
from .npy import MAX_BYTES

# Details of faults that are words of ours (tracks.checks); any other text in a detail is somebody's own.
WORDS = frozenset({gettext_noop("centre line"), gettext_noop("inner border"), gettext_noop("outer border")})


def explain(fault: PaddockError) -> str:
    """The fault's sentence in the reader's language, with its details filled in."""
    params = {key: gettext(value) if value in WORDS else value for key, value in fault.params.items()}
    return fault.reason.render(params, gettext(fault.reason.sentence))


def add_fault(form: forms.BaseForm, fault: PaddockError, field: str | None = None) -> None:
    """Show what a service refused: its sentence and its stable code, beside the form or one of its fields."""
    form.add_error(field, forms.ValidationError(explain(fault), code=fault.code))


class ImportTrackForm(forms.Form):
    """A track file of the community and what to call it."""

    name = forms.CharField(label=_("Name"), max_length=64)
    file = forms.FileField(
        label=_("Track file"),
        allow_empty_file=True,
        help_text=_(
            "A NumPy file (.npy) of the community: six columns in metres, centre x and y, inner border x and y, "
            "outer border x and y; the first point is the finish line."
        ),
        widget=forms.FileInput(attrs={"accept": ".npy"}),
    )

    look = forms.ChoiceField(
        label=_("Look"),
        choices=Look.choices,
        initial=Look.OFFICIAL,
        required=False,
        help_text=_("What cameras see of it: lines, dashes, greys and the wall. It stays as it is for good."),
    )

    def clean_look(self) -> str:
        """The official one where none is named."""
        return self.cleaned_data["look"] or Look.OFFICIAL

    def data_bytes(self) -> bytes:
        """The file's bytes, one more than any track may have at most, so that a huge upload is not read whole."""
        return self.cleaned_data["file"].read(MAX_BYTES + 1)

"""Forms of the garage."""

from collections.abc import Iterable
from typing import Any

from django import forms
from django.core.files.uploadedfile import UploadedFile
from django.utils.translation import gettext_lazy as _

from core.database.columns import length_of
from core.validators import visible_line
from paddock.packages.kinds import network_suffixes
from paddock.packages.read import UploadPart

from ..appearance.looks import Shell, VehicleLook
from ..models import TrainedModel

NAME_LIMIT = length_of(TrainedModel, "name")
DESCRIPTION_LIMIT = TrainedModel._meta.get_field("description").max_length


class FilesInput(forms.ClearableFileInput):
    allow_multiple_selected = True


class FilesField(forms.FileField):
    """One or more files; empty ones pass, so that the package reader reports the fault."""

    widget = FilesInput

    def clean(self, data: Iterable[UploadedFile] | UploadedFile | None, initial: object = None) -> list[UploadedFile]:
        files = list(data) if isinstance(data, list | tuple) else [data]
        return [super(FilesField, self).clean(file, initial) for file in files or [None]]


_ACCEPTED = (".gz", ".tgz", ".tar", ".xz", ".bz2", ".zip", ".data", ".onnx_data", ".bin", ".json")


class UploadForm(forms.Form):
    """One archive, or a network together with its metadata (and its weights, where they are a file of their own)."""

    files = FilesField(  # type: ignore[assignment]  # the files of a form are read by their fields here
        label=_("Files"),
        allow_empty_file=True,
        max_length=None,
        error_messages={"required": _("Choose a model's archive, or a network and its model_metadata.json.")},
    )
    name = forms.CharField(
        label=_("Name"),
        required=False,
        max_length=NAME_LIMIT,
        validators=[visible_line],
        help_text=_("Empty: the file name."),
    )
    description = forms.CharField(
        label=_("Description"), required=False, max_length=DESCRIPTION_LIMIT, validators=[visible_line]
    )
    checkpoint = forms.CharField(
        label=_("Checkpoint"),
        required=False,
        max_length=20,
        widget=forms.TextInput(attrs={"autocomplete": "off", "autocapitalize": "none"}),
        help_text=_(
            "For training folders only: best, last, or a number (48 for model_48.pb). Empty: the "
            "best by deepracer_checkpoints.json, otherwise the last."
        ),
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.fields["files"].widget.attrs["accept"] = ",".join((*_ACCEPTED, *network_suffixes()))

    def parts(self) -> list[UploadPart]:
        return [UploadPart(file.name or "", file.file) for file in self.cleaned_data["files"]]


class DescribeForm(forms.Form):
    """Another name and description for a model, and what it looks like in replays."""

    name = forms.CharField(label=_("Name"), max_length=NAME_LIMIT, validators=[visible_line])
    description = forms.CharField(
        label=_("Description"), required=False, max_length=DESCRIPTION_LIMIT, validators=[visible_line]
    )
    shell = forms.ChoiceField(label=_("Shell"), choices=Shell.choices, widget=forms.RadioSelect, required=False)
    colour = forms.RegexField(
        label=_("Colour"),
        regex=r"^#[0-9a-fA-F]{6}\Z",
        required=False,
        widget=forms.TextInput(attrs={"type": "color"}),
        error_messages={"invalid": _("Enter a colour as #rrggbb, such as #3b82f6.")},
    )

    def look(self, model: TrainedModel) -> VehicleLook:
        """What is left out of the look stays as it is."""
        values = self.cleaned_data
        return VehicleLook(values["shell"] or model.shell, values["colour"].lower() or model.colour)

"""What a model is downloaded as."""

from __future__ import annotations

import io
import json
import zipfile

from django.http import HttpResponse, HttpResponseBase

from faults import PlatformFault

from .models import TrainedModel


def package_of(model: TrainedModel) -> bytes:
    """A zip of the network and its ``model_metadata.json``, as this site, and any other Paddock, takes it.

    Raises PlatformFault ``storage_failed``.
    """
    file = io.BytesIO()
    try:
        with (
            model.network.onnx.open("rb") as onnx,
            zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        ):
            archive.writestr("model.onnx", onnx.read())
            archive.writestr("model_metadata.json", json.dumps(model.metadata, indent=2))
    except OSError as error:
        raise PlatformFault("storage_failed") from error
    return file.getvalue()


def download_of(model: TrainedModel) -> HttpResponse:
    """The package as a download that is named after the model."""
    return as_download(HttpResponse(package_of(model), content_type="application/zip"), f"{model.name}.zip")


def as_download(response: HttpResponseBase, name: str) -> HttpResponseBase:
    """The response as a file of this name, without letters that headers or file systems stumble over."""
    safe = "".join(letter if (letter.isalnum() and letter.isascii()) or letter in "-_." else "-" for letter in name)
    response["Content-Disposition"] = f'attachment; filename="{safe}"'
    response["Cache-Control"] = "private, no-store"
    return response

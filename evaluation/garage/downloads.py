"""Downloads of a model and of a run: package, export, original upload and logs."""

import io
import json
import zipfile
from collections.abc import Iterator

from django.contrib.auth.models import AnonymousUser
from django.http import FileResponse, HttpResponse, HttpResponseBase, StreamingHttpResponse

from accounts.models import Racer
from core.files.zip_stream import ZipPart, part_of, zipped
from paddock.errors import UserFault
from paddock.packages.kinds import CAR
from paddock.packages.metadata import MetadataDocument

from ..models import CompetitorResult, Evaluation, TrainedModel
from ..running.results import read_trace
from ..selectors import can_see_model
from ..stored_files import open_stored, read
from .export import export_in_sandbox
from .simulation_log import METADATA, settings_lines, trace_lines
from .uploads import package_limits


def package_of(model: TrainedModel) -> bytes:
    """A zip of the network and its ``model_metadata.json``, as any Paddock takes it. Raises PlatformFault
    ``storage_failed``, ``file_damaged``."""
    file = io.BytesIO()
    onnx = read(model.network.onnx.name or "")
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("model.onnx", onnx)
        archive.writestr("model_metadata.json", json.dumps(model.metadata, indent=2))
    return file.getvalue()


def download_of(model: TrainedModel) -> HttpResponseBase:
    return as_download(HttpResponse(package_of(model), content_type="application/zip"), f"{model.name}.zip")


def export_of(model: TrainedModel, form: str, *, racer_pk: int) -> HttpResponseBase:
    """The model in one of :data:`paddock.packages.kinds.EXPORTS` as a download. ``racer_pk``: the reader. Raises
    UserFault ``export_operator``, ``network_too_wide``, PlatformFault ``storage_failed``, ``file_damaged`` and those of
    :func:`.export.export_in_sandbox`."""
    onnx, about = read(model.network.onnx.name or ""), json.dumps(model.metadata).encode()
    archive = export_in_sandbox(onnx, about, form, package_limits(), racer_pk=racer_pk)
    name = f"{model.name}.tar.gz" if form == CAR else f"{model.name}-{form}.tar.gz"
    return as_download(HttpResponse(archive, content_type="application/gzip"), name)


def upload_of(model: TrainedModel) -> HttpResponseBase:
    """The uploaded file of a model, to the byte. Raises UserFault ``source_not_kept``, PlatformFault
    ``storage_failed``, ``file_damaged``."""
    if not model.source_file:
        raise UserFault("source_not_kept")
    file = open_stored(model.source_file.name or "")
    return as_download(FileResponse(file, content_type="application/octet-stream"), model.source_name)


def logs_of(evaluation: Evaluation, racer: Racer | AnonymousUser) -> HttpResponseBase:
    """All files of a finished evaluation as one zip, in the layout that the field's tools expect, with the car's
    ``model_metadata.json`` if the racer may see the model. Raises PlatformFault ``storage_failed``,
    ``file_damaged``."""
    metadata = evaluation.spec["metadata"] if can_see_model(racer, evaluation.model) else None
    cars = [(evaluation.result, ""), *((rival, f"-car{rival.number}") for rival in evaluation.result.rivals.all())]
    traces = [read_trace(car) for car, _ in cars]  # before the first byte is sent: a failure can still be reported
    parts = _log_parts(evaluation, [(*car, trace) for car, trace in zip(cars, traces, strict=True)], metadata)
    response = StreamingHttpResponse(zipped(parts), content_type="application/zip")
    return as_download(response, f"{evaluation.public_id}-logs.zip")


def _log_parts(
    evaluation: Evaluation, cars: list[tuple[CompetitorResult, str, bytes]], metadata: MetadataDocument | None
) -> Iterator[ZipPart]:
    stamp = f"{evaluation.ended_at:%Y%m%d%H%M%S}-{evaluation.public_id}"
    for car, suffix, trace in cars:
        name, own = f"{stamp}{suffix}", None if suffix else metadata
        yield part_of(f"sim-trace/evaluation/{name}/evaluation-simtrace/0-iteration.csv", [trace])
        yield part_of(f"metrics/evaluation/evaluation-{name}.json", [json.dumps(car.metrics, indent=1).encode()])
        head = settings_lines(evaluation.track.slug, metadata=own)
        yield part_of(f"logs/evaluation/{name}-simulation.log", [head, *trace_lines([trace])])
    if metadata is not None:
        yield part_of(METADATA, [json.dumps(metadata, indent=1).encode()])


def as_download(response: HttpResponseBase, name: str) -> HttpResponseBase:
    """The response as a file of this name, without letters that headers or file systems stumble over."""
    safe = "".join(letter if (letter.isalnum() and letter.isascii()) or letter in "-_." else "-" for letter in name)
    response["Content-Disposition"] = f'attachment; filename="{safe}"'
    response["Cache-Control"] = "private, no-store"
    return response

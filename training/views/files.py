"""What a training is downloaded as."""

from __future__ import annotations

from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase, StreamingHttpResponse
from django.views.decorators.http import require_safe

from accounts.who import racer_of
from evaluation.files import as_download, download_of
from training.files import SB3_TYPE, logs_zip, metrics_json, newest_simtrace, sb3_name, sb3_of

from .common import visible_training


@login_required
@require_safe
def training_package(request: HttpRequest, public_id: str, which: str) -> HttpResponseBase:
    """The best or the last model as a package: ONNX and model_metadata.json in a zip."""
    job = visible_training(request, public_id)
    model = job.best_model if which == "best" else job.last_model
    if model is None or model.deleted_at is not None:
        raise Http404
    return download_of(model)


@login_required
@require_safe
def training_sb3(request: HttpRequest, public_id: str) -> HttpResponseBase:
    """The model as stable-baselines3 saves it."""
    job = visible_training(request, public_id)
    data = sb3_of(job)
    if data is None:
        raise Http404
    return _file(data, SB3_TYPE, sb3_name(job, racer_of(request)))


@login_required
@require_safe
def training_logs(request: HttpRequest, public_id: str) -> HttpResponseBase:
    """Log, reward function, settings, metrics and sim-traces in one zip."""
    job = visible_training(request, public_id)
    response = StreamingHttpResponse(logs_zip(job), content_type="application/zip")
    return as_download(response, f"{job.name}-logs.zip")


@login_required
@require_safe
def training_metrics_file(request: HttpRequest, public_id: str) -> HttpResponseBase:
    """The training metrics JSON, as the community's tools read it."""
    job = visible_training(request, public_id)
    response = StreamingHttpResponse(metrics_json(job), content_type="application/json")
    return as_download(response, f"{job.name}-training-metrics.json")


@login_required
@require_safe
def training_trace(request: HttpRequest, public_id: str) -> HttpResponseBase:
    """The newest sim-trace as CSV."""
    job = visible_training(request, public_id)
    newest = newest_simtrace(job)
    if newest is None:
        raise Http404
    number, data = newest
    return _file(data, "text/csv; charset=utf-8", f"{job.name}-{number}-sim-trace.csv")


def _file(data: bytes, kind: str, name: str) -> HttpResponseBase:
    return as_download(HttpResponse(data, content_type=kind), name)

"""The garage: a racer's models."""

import hashlib
from functools import partial

from django.conf import settings
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.cache import cache
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.models import Racer
from accounts.quotas import limit_of
from accounts.request_racer import racer_of
from core.database.kept_queries import KeptQuery
from core.forms import add_fault, say_saved
from core.pages.faults import faults_reported, faults_shown
from core.pages.pager import kept_pages
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import by_slug
from paddock.packages.kinds import EXPORTS
from paddock.simulator.engine import ENGINE_ID

from ..models import TrainedModel
from ..selectors import can_stop_sharing, can_use_model, models_of, visible_model
from . import services
from .downloads import download_of, export_of, upload_of
from .forms import DescribeForm, UploadForm
from .quotas import MODELS
from .selectors import LONGEST_SEARCH, GarageSort, garage_of, with_last_runs
from .uploads import upload_summary

MODELS_PER_PAGE = 50
PICTURED_TRACK = "oval"
PICTURE_KEPT_S = 30 * 86400
_newest = KeptQuery(lambda racer: garage_of(Racer(pk=racer))[: MODELS_PER_PAGE + 1])


@login_required
@require_safe
def models(request: HttpRequest) -> HttpResponse:
    asked = " ".join(request.GET.get("q", "").replace("\0", "").split())[:LONGEST_SEARCH]
    sort = request.GET.get("sort", "")
    sort = sort if sort in GarageSort.values else GarageSort.NEWEST.value
    racer = racer_of(request)
    first = None if asked or sort != GarageSort.NEWEST else partial(_newest, racer=racer.pk)
    every = partial(garage_of, racer, search=asked, sort=sort)
    page = kept_pages(request.GET.get("page"), MODELS_PER_PAGE, first, every)
    context = {
        "page": page,
        "models": with_last_runs(page),
        "asked": asked,
        "sort": sort,
        "sorts": GarageSort.choices,
        "limit": limit_of(racer, MODELS.name),
    }
    return render(request, "evaluation/garage/models.html", context)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def model_upload(request: HttpRequest) -> HttpResponse:
    form = UploadForm(request.POST or None, request.FILES or None) if request.method == "POST" else UploadForm()
    status = 200
    if request.method == "POST":
        status = 422
        if form.is_valid():
            try:
                uploaded = services.upload_model(
                    owner=racer_of(request),
                    files=form.parts(),
                    name=form.cleaned_data["name"] or None,
                    description=form.cleaned_data["description"],
                    checkpoint=form.cleaned_data["checkpoint"],
                    keep_upload=True,
                    now=timezone.now(),
                )
            except UserFault as fault:
                add_fault(form, fault)
            except PlatformFault as fault:
                add_fault(form, fault)
                status = 503
            else:
                if uploaded.created:
                    messages.success(request, _("The model is in your garage."))
                else:
                    messages.info(request, _("This network is already in your garage under this name."))
                for sentence in upload_summary(uploaded.package):
                    messages.info(request, sentence)
                return redirect(uploaded.model)
    context = {"form": form, "limit_mb": settings.UPLOAD_LIMIT_MB}
    return render(request, "evaluation/garage/upload.html", context, status=status)


def _visible_model(request: HttpRequest, public_id: str) -> TrainedModel:
    shown = visible_model(racer_of(request), public_id)
    if shown is None:
        raise Http404
    return shown


@login_required
@require_safe
def model(request: HttpRequest, public_id: str) -> HttpResponse:
    """A model of mine, or one that somebody shares: what it is, what it drove, where mine can race."""
    shown = _visible_model(request, public_id)
    context = {
        "model": shown,
        "is_mine": can_use_model(request.user, shown),
        "can_stop_sharing": can_stop_sharing(request.user, shown),
    }
    return render(request, "evaluation/garage/model.html", context)


@login_required
@require_safe
def model_sensors(request: HttpRequest, public_id: str) -> HttpResponse:
    """What the sensors of a model see, as a picture (PNG). Models that read alike share one."""
    shown = _visible_model(request, public_id)
    png = _sensor_picture(tuple(shown.sensors), shown.metadata.get("lidar_config"))
    response = HttpResponse(png, content_type="image/png")
    response["Cache-Control"] = "private, max-age=86400"
    return response


def _sensor_picture(sensors: tuple[str, ...], lidar_config: dict | None) -> bytes:
    key = f"sensors {ENGINE_ID} {sensors} {sorted((lidar_config or {}).items())}"
    name = f"sensor-picture-{hashlib.sha256(key.encode()).hexdigest()}"
    png = cache.get(name)
    if png is None:
        # brings OpenCV along, which no other page needs
        from ..camera_replay.sensor_pictures import sensor_picture

        png = sensor_picture(by_slug(PICTURED_TRACK).geometry(), sensors, lidar_config)
        cache.set(name, png, PICTURE_KEPT_S)
    return png


@login_required
@require_safe
def model_package(request: HttpRequest, public_id: str) -> HttpResponseBase:
    """A model of mine, or one that somebody shares, as a package: ONNX and model_metadata.json in a zip."""
    return download_of(_visible_model(request, public_id))


@login_required
@require_safe
def model_export(request: HttpRequest, public_id: str, form: str) -> HttpResponseBase:
    """A model of mine, or one that somebody shares, in a format of others: for a car, for OpenVINO."""
    shown = _visible_model(request, public_id)
    if form not in EXPORTS:
        raise Http404
    with faults_reported(request):
        return export_of(shown, form, racer_pk=racer_of(request).pk)
    return redirect(shown)


@login_required
@require_safe
def model_uploaded(request: HttpRequest, public_id: str) -> HttpResponseBase:
    mine = get_object_or_404(models_of(request.user), public_id=public_id)
    with faults_reported(request):
        return upload_of(mine)
    return redirect(mine)


@login_required
@require_POST
def model_share(request: HttpRequest, public_id: str) -> HttpResponse:
    """Share one of my models with every racer, or (``stop``) keep it to myself again; admins stop what they must."""
    shown = _visible_model(request, public_id)
    is_mine = can_use_model(request.user, shown)
    if "stop" in request.POST:
        if not is_mine and not can_stop_sharing(request.user, shown):
            raise Http404
        services.stop_sharing_model(model=shown)
        messages.success(request, _("The model is no longer shared. Trainings started from it continue."))
        return redirect(shown) if is_mine else redirect("shared_models")
    if not is_mine:
        raise Http404
    with faults_reported(request):
        services.share_model(model=shown, now=timezone.now())
        done = _("Model shared: every racer can view it, download it and continue training from it.")
        messages.success(request, done)
        return redirect(shown)
    return redirect("models")


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def model_edit(request: HttpRequest, public_id: str) -> HttpResponse:
    mine = get_object_or_404(models_of(request.user), public_id=public_id)
    kept = {name: getattr(mine, name) for name in ("name", "description", "shell", "colour")}
    form = DescribeForm(request.POST or None, initial=kept)
    if request.method == "POST" and form.is_valid():
        with faults_shown(form):
            name, description = form.cleaned_data["name"], form.cleaned_data["description"]
            services.describe_model(model=mine, name=name, description=description, look=form.look(mine))
            say_saved(request, form)
            return redirect(mine)
    return render(
        request, "evaluation/garage/model_edit.html", {"model": mine, "form": form}, status=422 if form.errors else 200
    )


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def model_delete(request: HttpRequest, public_id: str) -> HttpResponse:
    mine = get_object_or_404(models_of(request.user), public_id=public_id)
    if request.method == "POST":
        services.delete_model(model=mine, now=timezone.now())
        messages.success(request, _("Model deleted. Results stay on boards."))
        return redirect("models")
    return render(request, "evaluation/garage/model_delete.html", {"model": mine})

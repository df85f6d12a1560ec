"""The reference lap of a track as a run document, which viewers play as a ghost, and its page."""

import gzip

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.urls import reverse
from django.utils.translation import get_language
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from evaluation.appearance.looks import VehicleLook
from paddock.geometry.track import DIRECTIONS
from tracks.models import ReferenceLap, Track
from tracks.reference.selectors import reference_lap

from .comparison import best_lap
from .document import RUN_FORMAT, RunDocument, car_document
from .responses import document_response
from .setup import ViewedRun, viewer_setup

LOOK = VehicleLook("formula", "#d4a72c")


def reference_address(track: Track, direction: str) -> str:
    """The address of the run document."""
    return f"{reverse('track_reference_replay', args=[track.slug])}?direction={direction}"


def viewed_reference(found: ReferenceLap) -> ViewedRun:
    """The best lap of a reference for :func:`.setup.viewer_setup`."""
    return {"url": reference_address(found.track, found.direction), "lap": best_lap(found.laps)}


@require_safe
def track_reference(request: HttpRequest, slug: str) -> HttpResponse:
    """The reference lap in the viewer."""
    found = _found(request, slug)
    scene = f"{reverse('track_scene', args=[slug])}?direction={found.direction}"
    context = {
        "track": found.track,
        "reference": found,
        "viewer": viewer_setup(scene, [viewed_reference(found)], page=request.path),
    }
    return render(request, "races/replays/reference.html", context)


@require_safe
def track_reference_replay(request: HttpRequest, slug: str) -> HttpResponse:
    """The run document (:mod:`.document`) of a reference."""
    found = _found(request, slug)
    key = "reference document", RUN_FORMAT, found.pk, found.trace_sha256, get_language()

    def made() -> RunDocument:
        trace = gzip.decompress(bytes(found.trace))
        return {
            **car_document(0, _("Reference lap"), LOOK, trace, found.laps),
            "run": "",
            "href": found.track.get_absolute_url(),
            "engine": found.engine,
            "track": slug,
            "direction": found.direction,
            "bots": [],
            "boxes": [],
            "rivals": [],
        }

    return document_response(request, key, made)


def _found(request: HttpRequest, slug: str) -> ReferenceLap:
    track = get_object_or_404(Track, slug=slug, length_m__isnull=False)
    direction = request.GET.get("direction", track.direction)
    found = reference_lap(track, direction) if direction in DIRECTIONS else None
    if found is None:
        raise Http404
    return found

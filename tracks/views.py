"""Track pages."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_safe

from accounts.quotas import limit_of
from accounts.request_racer import racer_of
from core.pages.faults import faults_shown
from core.pages.pager import LeanPaginator

from .drawing.printing import FORMS, print_facts, print_file
from .forms import ImportTrackForm
from .models import Track
from .selectors import closest_tracks, figure, figures, found_tracks, track_named, with_figures
from .services import TRACKS, import_track

TRACKS_PER_PAGE = 24


@require_safe
def tracks(request: HttpRequest) -> HttpResponse:
    """Cards of all tracks with their figures, searched and sorted."""
    return _found(request, " ".join(request.GET.get("q", "").replace("\0", "").split())[:64])


def _found(request: HttpRequest, asked: str, status: int = 200) -> HttpResponse:
    """The tracks that a search finds, or the closest names."""
    sorted_by = figure(request.GET.get("sort", ""))
    found = found_tracks(search=asked, sort=sorted_by.name)
    page = LeanPaginator(found, TRACKS_PER_PAGE).get_page(request.GET.get("page"))
    closest = [] if page.object_list or not asked else closest_tracks(asked)
    context = {"page": page, "asked": asked, "sorted_by": sorted_by, "figures": figures(), "closest": closest}
    return render(request, "tracks/tracks.html", context, status=status)


@require_safe
def tracks_to_choose(request: HttpRequest) -> HttpResponse:
    """Pictures and descriptions of all tracks, for the forms that ask for one of them."""
    return render(request, "tracks/to_choose.html", {"tracks": found_tracks(), "figures": figures()})


@require_safe
def track(request: HttpRequest, slug: str) -> HttpResponse:
    """One track: map, figures and the races on it."""
    shown = with_figures(Track.objects.select_related("owner")).filter(slug=slug).first()
    if shown is not None:
        return render(request, "tracks/track.html", {"track": shown, "figures": figures()})
    if named := track_named(slug):
        return redirect(named)
    return _found(request, slug, status=404)


@require_safe
def track_print(request: HttpRequest, slug: str) -> HttpResponse:
    """A track at its true size: files to print, and its tape in metres."""
    shown = get_object_or_404(Track, slug=slug, length_m__isnull=False)
    return render(request, "tracks/print.html", {"track": shown, **print_facts(shown)})


@require_safe
def track_file(request: HttpRequest, slug: str, form: str) -> HttpResponse:
    shown = get_object_or_404(Track, slug=slug, length_m__isnull=False)
    if form not in FORMS:
        raise Http404
    name, kind, content = print_file(shown, form)
    headers = {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "public, max-age=86400"}
    return HttpResponse(content, content_type=kind, headers=headers)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def import_track_page(request: HttpRequest) -> HttpResponse:
    """Import a track file; on success its own page shows the map."""
    form = ImportTrackForm(request.POST or None, request.FILES or None)
    if request.method == "POST" and form.is_valid():
        with faults_shown(form):
            made = import_track(
                data=form.data_bytes(),
                name=form.cleaned_data["name"],
                owner=racer_of(request),
                now=timezone.now(),
                look=form.cleaned_data["look"],
                is_open=form.cleaned_data["is_open"],
                scale=form.cleaned_data["scale"],
                least_width_m=form.cleaned_data["least_width_m"] or 0.0,
            )
            messages.success(request, _("Track imported. Anyone can create a race on it now."))
            return redirect(made)
    context = {"form": form, "limit": limit_of(racer_of(request), TRACKS.name)}
    return render(request, "tracks/import.html", context, status=422 if form.errors else 200)

"""A racer's picture: sending it, taking it away, and showing it."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import FileResponse, Http404, HttpRequest, HttpResponse
from django.http.response import HttpResponseBase
from django.shortcuts import redirect
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from core.pages.faults import faults_reported
from paddock.errors import PlatformFault, UserFault

from ..models import Racer
from ..request_racer import racer_of
from .services import open_picture, remove_picture, set_picture

A_YEAR_S = 31_536_000  # another picture has another address


@login_required
@require_POST
def picture_set(request: HttpRequest) -> HttpResponse:
    file = request.FILES.get("picture")
    with faults_reported(request):
        if file is None:
            raise UserFault("picture_format")
        set_picture(racer=racer_of(request), file=file, now=timezone.now())
        messages.success(request, _("Saved."))
    return redirect("settings")


@login_required
@require_POST
def picture_remove(request: HttpRequest) -> HttpResponse:
    remove_picture(racer=racer_of(request))
    messages.success(request, _("Your picture is removed."))
    return redirect("settings")


@require_safe
def avatar(request: HttpRequest, name: str) -> HttpResponseBase:
    """A picture that some racer has; one that was removed is gone at once."""
    if not Racer.objects.filter(avatar=name).exists():
        raise Http404
    try:
        response = FileResponse(open_picture(name), content_type="image/webp")
    except PlatformFault:
        raise Http404 from None
    response["Cache-Control"] = f"public, max-age={A_YEAR_S}, immutable"
    response["X-Content-Type-Options"] = "nosniff"
    return response

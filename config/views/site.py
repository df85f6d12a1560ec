"""Pages that belong to the site as a whole."""

from __future__ import annotations

from django.conf import settings
from django.http import (
    HttpRequest,
    HttpResponse,
    HttpResponseRedirect,
    JsonResponse,
)
from django.shortcuts import render
from django.templatetags.static import static
from django.utils import timezone
from django.utils.http import url_has_allowed_host_and_scheme
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.http import require_GET, require_POST, require_safe

from config.health import readiness
from core.templatetags.site import THEMES
from league.selectors.overview import current_season

A_YEAR_S = 365 * 24 * 3600


@require_safe
def about(request: HttpRequest) -> HttpResponse:
    """How it works and the rules."""
    season = current_season(timezone.now())
    percent = f"{season.promotion_percent.normalize():f}" if season else None
    return render(request, "config/about.html", {"upload_limit_mb": settings.UPLOAD_LIMIT_MB, "percent": percent})


@require_safe
def favicon(request: HttpRequest) -> HttpResponse:
    """Where browsers look for the site's mark on pages that do not name it: the admin site, downloads."""
    return HttpResponseRedirect(static("mark.svg"))


@csrf_exempt  # pages for guests carry no token, and a theme is all that anybody could make of it
@require_POST
def set_theme(request: HttpRequest) -> HttpResponse:
    """Keep the theme in a cookie; ``toggle`` turns dark into light and anything else into dark."""
    wanted = request.POST.get("theme", "")
    if wanted == "toggle":
        wanted = "light" if request.COOKIES.get("theme") == "dark" else "dark"
    target = request.POST.get("next", "/")
    if not url_has_allowed_host_and_scheme(target, {request.get_host()}, require_https=request.is_secure()):
        target = "/"
    response = HttpResponseRedirect(target)
    if wanted in THEMES:
        response.set_cookie("theme", wanted, max_age=A_YEAR_S, samesite="Lax", secure=settings.SESSION_COOKIE_SECURE)
    else:
        response.delete_cookie("theme", samesite="Lax")
    return response


@never_cache
@require_GET
def stream(request: HttpRequest) -> HttpResponse:
    """What whoever asks for the stream is told while no stream process takes them: to go on by asking."""
    return HttpResponse("event: away\ndata: {}\n\n", content_type="text/event-stream")


@never_cache
@require_GET
def stream_clock(request: HttpRequest) -> HttpResponse:
    """The time, while no stream process tells it."""
    return JsonResponse({"now": round(timezone.now().timestamp() * 1000)})


@never_cache
@require_GET
def health_live(request: HttpRequest) -> HttpResponse:
    """This process answers."""
    return HttpResponse("ok\n", content_type="text/plain")


@never_cache
@require_GET
def health_ready(request: HttpRequest) -> HttpResponse:
    """All that the site needs is as it should be: 200, or 503; each part by its name, and what was measured."""
    found = readiness()
    return JsonResponse({**found.parts, "figures": found.figures}, status=200 if found.is_ready else 503)

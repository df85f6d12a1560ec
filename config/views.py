"""Pages of the site as a whole: about, theme, health, and the answers without a stream process."""

import sys

from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseRedirect, JsonResponse
from django.shortcuts import render
from django.template.loader import render_to_string
from django.templatetags.static import static
from django.utils import timezone
from django.utils.crypto import constant_time_compare
from django.utils.http import url_has_allowed_host_and_scheme
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.http import require_GET, require_POST, require_safe

from config.middleware.platform_faults import RETRY_AFTER_S
from config.operations.health import readiness
from core.logs.filters import outage_of
from core.templatetags.site import THEMES
from league.seasons.selectors import current_season

A_YEAR_S = 365 * 24 * 3600


@require_safe
def about(request: HttpRequest) -> HttpResponse:
    season = current_season(timezone.now())
    percent = f"{season.promotion_percent.normalize():f}" if season else None
    return render(request, "config/about.html", {"upload_limit_mb": settings.UPLOAD_LIMIT_MB, "percent": percent})


@require_safe
def favicon(request: HttpRequest) -> HttpResponse:
    """Where browsers look for the site's mark on pages that do not name it: the admin site, downloads."""
    return HttpResponseRedirect(static("mark.svg"))


def server_error(request: HttpRequest) -> HttpResponse:
    """Django's ``handler500``: what failed is logged already. An outage is temporary, so its answer is 503."""
    error = sys.exc_info()[1]
    status = 503 if error is not None and outage_of(error) is not None else 500
    response = HttpResponse(render_to_string("500.html", {"status": status}), status=status)
    if status == 503:
        response["Retry-After"] = str(RETRY_AFTER_S)
    return response


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
    """The answer for a stream while no stream process takes it: the page keeps polling."""
    return HttpResponse("event: away\ndata: {}\n\n", content_type="text/event-stream")


@never_cache
@require_GET
def stream_clock(request: HttpRequest) -> HttpResponse:
    """The time, while there is no stream process."""
    return JsonResponse({"now": round(timezone.now().timestamp() * 1000)})


@never_cache
@require_GET
def health_live(request: HttpRequest) -> HttpResponse:
    return HttpResponse("ok\n", content_type="text/plain")


@never_cache
@require_GET
def health_ready(request: HttpRequest) -> HttpResponse:
    """All that the site needs is as it should be: 200, or 503; each part by its name, what was measured, and its
    age in seconds."""
    found = readiness()
    body = {**found.parts, "figures": found.figures, "age_s": found.age_s}
    return JsonResponse(body, status=200 if found.is_ready else 503, headers={"Age": str(int(found.age_s))})


@never_cache
@require_GET
def metrics(request: HttpRequest) -> HttpResponse:
    """The metrics of this machine for Prometheus: 404 where there is no token for them, 401 without it."""
    if not settings.METRICS_TOKEN:
        raise Http404
    scheme, _, token = request.headers.get("Authorization", "").partition(" ")
    if scheme.lower() != "bearer" or not constant_time_compare(token, settings.METRICS_TOKEN):
        return HttpResponse(status=401, headers={"WWW-Authenticate": "Bearer"})
    from prometheus_client.exposition import choose_encoder

    from config.operations.metrics import registry  # loads a library

    encode, content_type = choose_encoder(request.headers.get("Accept", ""))
    return HttpResponse(encode(registry()), content_type=content_type)

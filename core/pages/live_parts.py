"""Parts of a page that an open page reloads while a job runs."""

from collections.abc import Callable

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render


def live_part(
    request: HttpRequest, mark: str, template: str, context: Callable[[], dict[str, object]], whole: str = ""
) -> HttpResponse:
    """A part of a page, or 204 while ``?seen=`` is ``mark``. ``whole``: the element that ``template`` replaces at the
    end."""
    if mark == request.GET.get("seen"):
        response = HttpResponse(status=204)
    else:
        response = render(request, template, context())
        if whole:
            response["HX-Retarget"], response["HX-Reswap"] = whole, "outerHTML"
    response["Cache-Control"] = "private, no-store"
    return response

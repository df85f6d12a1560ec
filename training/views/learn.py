"""The course: its list, a lesson, and how to train on another machine."""

from __future__ import annotations

from pathlib import Path

from django.conf import settings
from django.http import FileResponse, Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.utils.translation import get_language
from django.views.decorators.http import require_safe

from accounts.classes import note_lesson
from accounts.who import racer_of
from training.lessons import BY_SLUG, LESSONS

from .common import closed_because

WRITTEN_IN = ("en", "ko")
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
EXAMPLE = "train_a_car.py"
EXAMPLE_TYPES = {EXAMPLE: "text/x-python; charset=utf-8", "train_a_car.ipynb": "application/x-ipynb+json"}
PACKAGE_TYPES = {".whl": "application/zip", ".gz": "application/gzip"}


@require_safe
def learn(request: HttpRequest) -> HttpResponse:
    """All lessons."""
    return render(request, "learn/lessons.html", {"lessons": LESSONS})


@require_safe
def lesson(request: HttpRequest, slug: str) -> HttpResponse:
    """One lesson in the reader's language."""
    if slug not in BY_SLUG:
        raise Http404
    if request.user.is_authenticated:
        note_lesson(racer=racer_of(request), slug=slug, now=timezone.now())
    index = LESSONS.index(BY_SLUG[slug])
    context = {
        "lesson": LESSONS[index],
        "number": index + 1,
        "count": len(LESSONS),
        "before": LESSONS[index - 1] if index else None,
        "after": LESSONS[index + 1] if index + 1 < len(LESSONS) else None,
        "text": f"lessons/{_language()}/{slug}.html",
        "closed": closed_because(),
    }
    return render(request, "learn/lesson.html", context)


@require_safe
def real_car(request: HttpRequest) -> HttpResponse:
    """How a model comes onto a physical car, in the reader's language."""
    return render(request, "learn/real_car.html", {"text": f"guides/{_language()}/real-car.html"})


def _language() -> str:
    """The language that a text is shown in."""
    language = (get_language() or "").split("-")[0]
    return language if language in WRITTEN_IN else WRITTEN_IN[0]


@require_safe
def elsewhere(request: HttpRequest) -> HttpResponse:
    """How to train on a machine of one's own, with the example to read, and the package where there is one."""
    context = {"code": (EXAMPLES / EXAMPLE).read_text(), "packages": _packages()}
    return render(request, "learn/elsewhere.html", context)


def _packages() -> list[str]:
    """The files of the racers' package that ``make package`` has built, a wheel first."""
    return sorted(
        (path.name for path in (settings.BASE_DIR / "dist").glob("paddock_racing-*") if path.suffix in PACKAGE_TYPES),
        key=lambda name: (not name.endswith(".whl"), name),
    )


@require_safe
def elsewhere_file(request: HttpRequest, name: str) -> FileResponse:
    """The example, the notebook or the package as a download."""
    if name in _packages():
        path = settings.BASE_DIR / "dist" / name
        return FileResponse(path.open("rb"), as_attachment=True, filename=name, content_type=PACKAGE_TYPES[path.suffix])
    if name not in EXAMPLE_TYPES:
        raise Http404
    return FileResponse(
        (EXAMPLES / name).open("rb"), as_attachment=True, filename=name, content_type=EXAMPLE_TYPES[name]
    )

"""The course: its list, a lesson, and how to train on another machine."""

from __future__ import annotations

from pathlib import Path

from django.http import FileResponse, Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.translation import get_language
from django.views.decorators.http import require_safe

from training.lessons import BY_SLUG, LESSONS

from .common import closed_because

WRITTEN_IN = ("en", "ko")
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
EXAMPLE = "train_a_car.py"
EXAMPLE_TYPES = {EXAMPLE: "text/x-python; charset=utf-8", "train_a_car.ipynb": "application/x-ipynb+json"}


@require_safe
def learn(request: HttpRequest) -> HttpResponse:
    """All lessons."""
    return render(request, "learn/lessons.html", {"lessons": LESSONS})


@require_safe
def lesson(request: HttpRequest, slug: str) -> HttpResponse:
    """One lesson in the reader's language."""
    if slug not in BY_SLUG:
        raise Http404
    index = LESSONS.index(BY_SLUG[slug])
    language = (get_language() or "").split("-")[0]
    context = {
        "lesson": LESSONS[index],
        "number": index + 1,
        "count": len(LESSONS),
        "before": LESSONS[index - 1] if index else None,
        "after": LESSONS[index + 1] if index + 1 < len(LESSONS) else None,
        "text": f"lessons/{language if language in WRITTEN_IN else WRITTEN_IN[0]}/{slug}.html",
        "closed": closed_because(),
    }
    return render(request, "learn/lesson.html", context)


@require_safe
def elsewhere(request: HttpRequest) -> HttpResponse:
    """How to train on a machine of one's own, with the example to read."""
    return render(request, "learn/elsewhere.html", {"code": (EXAMPLES / EXAMPLE).read_text()})


@require_safe
def elsewhere_file(request: HttpRequest, name: str) -> FileResponse:
    """The example or the notebook as a download."""
    if name not in EXAMPLE_TYPES:
        raise Http404
    return FileResponse(
        (EXAMPLES / name).open("rb"), as_attachment=True, filename=name, content_type=EXAMPLE_TYPES[name]
    )

"""The course: its list, and a lesson."""

from __future__ import annotations

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.translation import get_language
from django.views.decorators.http import require_safe

from training.course import BY_SLUG, LESSONS

from .common import closed_because

WRITTEN_IN = ("en", "ko")


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

"""The pages of the course: list, lesson, training on another machine."""

from pathlib import Path

from django.conf import settings
from django.http import FileResponse, Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.utils.translation import get_language
from django.views.decorators.http import require_safe

from accounts.class_accounts.services import note_lesson
from accounts.request_racer import racer_of
from training.lessons.catalogue import BY_SLUG, LESSONS

from ..jobs.selectors import closed_because

WRITTEN_IN = ("en", "ko")
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
EXAMPLE = "train_a_car.py"
EXAMPLE_TYPES = {EXAMPLE: "text/x-python; charset=utf-8", "train_a_car.ipynb": "application/x-ipynb+json"}
PACKAGE_TYPES = {".whl": "application/zip", ".gz": "application/gzip"}


@require_safe
def learn(request: HttpRequest) -> HttpResponse:
    return render(request, "training/lessons/list.html", {"lessons": LESSONS})


@require_safe
def lesson(request: HttpRequest, slug: str) -> HttpResponse:
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
    return render(request, "training/lessons/lesson.html", context)


@require_safe
def real_car(request: HttpRequest) -> HttpResponse:
    return render(request, "training/lessons/real_car.html", {"text": f"guides/{_language()}/real-car.html"})


def _language() -> str:
    language = (get_language() or "").split("-")[0]
    return language if language in WRITTEN_IN else WRITTEN_IN[0]


@require_safe
def elsewhere(request: HttpRequest) -> HttpResponse:
    code = (EXAMPLES / EXAMPLE).read_text()
    context = {"code": code, "packages": _packages("paddock_racing"), "names": _packages("paddock_deepracer")}
    return render(request, "training/lessons/elsewhere.html", context)


def _packages(name: str = "paddock_*") -> list[str]:
    """The files of a package that were built here, its wheel first."""
    return sorted(
        (path.name for path in (settings.BASE_DIR / "dist").glob(f"{name}-*") if path.suffix in PACKAGE_TYPES),
        key=lambda name: (not name.endswith(".whl"), name),
    )


@require_safe
def elsewhere_file(request: HttpRequest, name: str) -> FileResponse:
    if name in _packages():
        path = settings.BASE_DIR / "dist" / name
        return FileResponse(path.open("rb"), as_attachment=True, filename=name, content_type=PACKAGE_TYPES[path.suffix])
    if name not in EXAMPLE_TYPES:
        raise Http404
    return FileResponse(
        (EXAMPLES / name).open("rb"), as_attachment=True, filename=name, content_type=EXAMPLE_TYPES[name]
    )

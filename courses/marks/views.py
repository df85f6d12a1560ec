"""The teacher's table of marks, its files, and regrades."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.db.models import prefetch_related_objects
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.text import slugify
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from accounts.models import RacerGroup
from accounts.request_racer import racer_of
from core.forms import number_sent
from core.pages.faults import faults_reported

from ..assignments.students import names_of, students_named
from ..assignments.views import taught_assignment
from ..grading.members import groups_taught_by
from ..models import Assignment, Regrade
from . import services
from .exports import FORMS, digest_of
from .table import SORTS, assignments_of, mark_table

PAST = 20  # regrades shown


@login_required
@never_cache
@require_safe
def assignment_marks(request: HttpRequest, public_id: str) -> HttpResponse:
    """All students with their marks, sorted by a column."""
    assignment = taught_assignment(request, public_id)
    prefetch_related_objects([assignment], "parts")
    sort = request.GET.get("sort", "name")
    sort, backwards = sort.removeprefix("-"), sort.startswith("-")
    rows = mark_table(assignment, sort if sort in SORTS else "name", backwards=backwards)
    parts = list(assignment.parts.all())
    context = {
        "assignment": assignment,
        "is_teacher": True,
        "rows": rows,
        "parts": parts,
        "full": sum(part.points for part in parts),
        "sort": sort,
        "backwards": backwards,
        "left_out": [row.student.name for row in rows if not row.student.student_id],
        "waiting": sum(row.state == "waiting" for row in rows),
    }
    return render(request, "courses/marks/marks.html", context)


@login_required
@never_cache
@require_safe
def assignment_marks_csv(request: HttpRequest, public_id: str) -> HttpResponse:
    """The marks of an assignment as a file; ``?form=``: moodle, canvas or plain."""
    assignment = taught_assignment(request, public_id)
    form, made = _made([assignment], request.GET.get("form", "plain"))
    return _download(made, f"{slugify(assignment.title) or 'marks'}-{form}", timezone.now())


@login_required
@never_cache
@require_safe
def group_marks(request: HttpRequest, slug: str) -> HttpResponse:
    """The marks of all published assignments of a group as a file. The session notes that they were downloaded."""
    group = get_object_or_404(groups_taught_by(request.user), slug=slug)
    form, made = _made(assignments_of(group), request.GET.get("form", "plain"))
    request.session[downloaded_key(group)] = digest_of(group)
    return _download(made, f"{group.slug}-{form}", timezone.now())


def downloaded_key(group: RacerGroup) -> str:
    """Where a session keeps which marks of a group were downloaded (:func:`courses.marks.exports.digest_of`)."""
    return f"marks_downloaded_{group.pk}"


def marks_are_downloaded(request: HttpRequest, group: RacerGroup) -> bool:
    """Whether this session has downloaded the marks of a group as they are now."""
    return request.session.get(downloaded_key(group)) == digest_of(group)


def _made(assignments: Sequence[Assignment], form: str) -> tuple[str, bytes]:
    if form not in FORMS or not assignments:
        raise Http404
    return form, FORMS[form](assignments)


def _download(made: bytes, name: str, now: datetime) -> HttpResponse:
    response = HttpResponse(made, content_type="text/csv; charset=utf-8")
    response["Content-Disposition"] = f'attachment; filename="{name}-{now:%Y%m%d-%H%M}.csv"'
    response["Cache-Control"] = "private, no-store"
    return response


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def assignment_regrade(request: HttpRequest, public_id: str) -> HttpResponse:
    """Old and new marks side by side after the rules changed; nothing changes before they are applied."""
    assignment, by, now = taught_assignment(request, public_id), racer_of(request), timezone.now()
    with faults_reported(request):
        if request.POST.get("do") == "propose":
            reason = " ".join(request.POST.get("reason", "").split())[:200]
            if not reason:
                messages.error(request, _("Enter a reason. It stays in the log."))
            else:
                services.propose_regrade(assignment=assignment, by=by, reason=reason, now=now)
        elif request.POST.get("do") == "apply":
            own = Regrade.objects.filter(assignment=assignment)
            regrade = get_object_or_404(own, pk=number_sent(request, "regrade"))
            services.apply_regrade(assignment=assignment, regrade=regrade, by=by, now=now)
            messages.success(request, _("Marks changed."))
    if request.method == "POST":
        return redirect("assignment_regrade", assignment.public_id)
    found = Regrade.objects.filter(assignment=assignment).select_related("asked_by", "applied_by")
    regrades = list(found[:PAST])
    current = next((one for one in regrades if one.rules_version == assignment.rules_version), None)
    rows = current.rows if current and current.applied_at is None and assignment.awaits_regrade else []
    names = names_of(students_named(assignment.group, [row["racer"] for one in regrades for row in one.rows]))
    context = {
        "assignment": assignment,
        "is_teacher": True,
        "current": current if current and current.applied_at is None and assignment.awaits_regrade else None,
        "rows": rows,
        "past": [one for one in regrades if one.applied_at is not None],
        "names": names,
    }
    return render(request, "courses/marks/regrade.html", context)

"""The teacher's pages: make, change, publish, delete and copy assignments; their log."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

from django import forms
from django.apps import apps
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.exceptions import FieldDoesNotExist
from django.db import transaction
from django.db.models import Prefetch, Q
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.class_accounts.services import make_class
from accounts.models import RacerGroup
from accounts.request_racer import racer_of
from core.audit.acts import ACTS
from core.audit.models import AuditEntry
from core.pages import form_nonce
from core.pages.faults import faults_reported, faults_shown, report_fault
from paddock.errors import UserFault
from races.test_runs.forms import own_preview

from ..grading.members import groups_taught_by
from ..models import Assignment, AssignmentPart, Attempt, PartTrack, SubmissionGroup
from . import services
from .forms import AssignmentForm, PartForm, show_fault
from .parts import PartValues
from .selectors import assignments_taught_by
from .students import names_of, students_named

LOGGED = 300
BOOKKEEPING = {"rules_version", "marked_version", "marked_rules"}  # of no use to a reader of the log


def taught_assignment(request: HttpRequest, public_id: str) -> Assignment:
    """The assignment, or 404 unless the reader teaches its group."""
    found = assignments_taught_by(request.user).select_related("group__classroom")
    return get_object_or_404(found, public_id=public_id)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def assignment_new(request: HttpRequest) -> HttpResponse:
    """Make a draft for a group that the reader teaches; ``?group=`` chooses it."""
    now, groups = timezone.now(), groups_taught_by(request.user).order_by("name")
    if not groups.exists():
        raise Http404
    initial = {"group": request.GET["group"]} if "group" in request.GET else {}
    form = AssignmentForm(request.POST or None, groups=groups, now=now, initial=initial)
    once = request.POST.get("once", "")
    if request.method == "POST" and form.is_valid():
        if not form_nonce.claim(once):
            return redirect("assignments")
        try:
            made = services.make_assignment(
                group=form.cleaned_data["group"], by=racer_of(request), now=now, **form.values()
            )
        except UserFault as fault:
            form_nonce.release(once)
            show_fault(form, fault)
        else:
            messages.success(request, _("Draft created. Add its parts."))
            return redirect("assignment_part_new", made.public_id)
    context = {"form": form, "once": form_nonce.new_nonce()}
    return render(request, "courses/assignments/form.html", context, status=422 if form.errors else 200)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def assignment_edit(request: HttpRequest, public_id: str) -> HttpResponse:
    """Change times, limits and texts; the parts are listed."""
    assignment, now = taught_assignment(request, public_id), timezone.now()
    form = AssignmentForm(request.POST or None, assignment=assignment, now=now)
    if request.method == "POST" and form.is_valid():
        try:
            changed = services.change_assignment(assignment=assignment, by=racer_of(request), now=now, **form.values())
        except UserFault as fault:
            show_fault(form, fault)
        else:
            return _saved(request, changed)
    shown = get_object_or_404(Assignment.objects.select_related("group__classroom"), pk=assignment.pk)
    parts = list(shown.parts.all())
    context = {
        "assignment": shown,
        "is_teacher": True,
        "form": form,
        "parts": parts,
        "full": sum(part.points for part in parts),
        "is_driven": is_driven(shown),
    }
    return render(request, "courses/assignments/form.html", context, status=422 if form.errors else 200)


def _saved(request: HttpRequest, assignment: Assignment) -> HttpResponse:
    messages.success(request, _("Saved."))
    if assignment.awaits_regrade:
        messages.warning(request, _("The marks stay as they are until you regrade."))
    return redirect("assignment_edit", assignment.public_id)


def is_driven(assignment: Assignment) -> bool:
    """Whether tracks and race rules stay, because somebody has handed in or the hidden tracks are drawn."""
    return assignment.drawn_at is not None or Attempt.objects.filter(assignment=assignment).exists()


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def assignment_part(request: HttpRequest, public_id: str, number: int | None = None) -> HttpResponse:
    """Add a part, or change or remove one."""
    assignment, now, by = taught_assignment(request, public_id), timezone.now(), racer_of(request)
    tracks = Prefetch("tracks", PartTrack.objects.select_related("track").order_by("number"))
    parts = list(assignment.parts.prefetch_related(tracks))
    part = next((one for one in parts if one.number == number), None)
    driven = is_driven(assignment)
    if (number is not None and part is None) or (number is None and driven):
        raise Http404
    removes = request.POST.get("do") == "remove" and part is not None
    form = PartForm(None if removes else request.POST or None, part=part, is_driven=driven)
    if removes or (request.method == "POST" and form.is_valid()):
        wanted = [values_as_stored(one) for one in parts if one != part]
        if not removes:
            wanted.insert(len(parts) if part is None else parts.index(part), form.values())
        once = request.POST.get("once", "")
        if number is None and not form_nonce.claim(once):
            return redirect("assignment_edit", assignment.public_id)
        try:
            changed = services.change_assignment(assignment=assignment, by=by, now=now, parts=wanted)
        except UserFault as fault:
            form_nonce.release(once)
            if removes:
                report_fault(request, fault)
                return redirect("assignment_edit", assignment.public_id)
            show_fault(form, fault)
        else:
            return _saved(request, changed)
    context = {
        "assignment": assignment,
        "part": part,
        "form": form,
        "is_driven": driven,
        "layout": own_preview(form, submitted=form.is_bound),
        "once": form_nonce.new_nonce(),
    }
    return render(request, "courses/assignments/part.html", context, status=422 if form.errors else 200)


def values_as_stored(part: AssignmentPart) -> PartValues:
    """A part as the services take it."""
    return {
        "title": part.title,
        "points": part.points,
        "pass_rule": part.pass_rule,
        "pass_params": part.pass_params,
        "rules": part.rules,
        "hidden_tracks": part.hidden_tracks,
        "tracks": [(one.track, "shown" if one.kind == "shown" else "candidate") for one in part.tracks.all()],
    }


@login_required
@require_POST
def assignment_publish(request: HttpRequest, public_id: str) -> HttpResponse:
    assignment = taught_assignment(request, public_id)
    with faults_reported(request):
        services.publish_assignment(assignment=assignment, by=racer_of(request), now=timezone.now())
        messages.success(request, _("Published. The students see it."))
        return redirect(assignment)
    return redirect("assignment_edit", assignment.public_id)


@login_required
@require_POST
def assignment_delete(request: HttpRequest, public_id: str) -> HttpResponse:
    assignment = taught_assignment(request, public_id)
    if request.POST.get("confirm", "").strip() != assignment.title:
        messages.error(request, _("Type the title of the assignment to delete it."))
        return redirect("assignment_edit", assignment.public_id)
    with faults_reported(request):
        services.delete_assignment(assignment=assignment, by=racer_of(request))
        messages.success(request, _("Assignment deleted."))
    return redirect("assignments")


@login_required
@never_cache
@require_safe
def assignment_log(request: HttpRequest, public_id: str) -> HttpResponse:
    """What was done about an assignment, the latest first."""
    assignment = taught_assignment(request, public_id)
    attempts = Attempt.objects.filter(assignment=assignment, refunded_at__isnull=False).values_list("pk", flat=True)
    groups = SubmissionGroup.objects.filter(assignment=assignment).values_list("pk", flat=True)
    about = Q(target_kind="courses.assignment", target_id=str(assignment.pk))
    about |= Q(target_kind="courses.attempt", target_id__in=list(map(str, attempts)))
    about |= Q(target_kind="courses.submissiongroup", target_id__in=list(map(str, groups)))
    entries = list(AuditEntry.objects.filter(about).select_related("actor").order_by("-pk")[:LOGGED])
    for entry in entries:
        entry.changes = {
            _label(entry.target_kind, name): pair for name, pair in entry.changes.items() if name not in BOOKKEEPING
        }
    students = students_named(assignment.group, {entry.racer_id for entry in entries if entry.racer_id})
    context = {
        "assignment": assignment,
        "is_teacher": True,
        "rows": [(one, ACTS[one.action].label if one.action in ACTS else one.action) for one in entries],
        "names": names_of(students),
    }
    return render(request, "courses/assignments/log.html", context)


def _label(kind: str, name: str) -> str:
    """A column's name as people read it."""
    try:
        return str(getattr(apps.get_model(kind)._meta.get_field(name), "verbose_name", name))
    except FieldDoesNotExist:
        return name


class CopyAssignmentsForm(forms.Form):
    """Where the assignments of a group are copied to, and how much later."""

    to_group = forms.ChoiceField(label=gettext_lazy("Copy to"), required=False)
    name = forms.CharField(label=gettext_lazy("Name of the new class"), required=False, max_length=64)
    weeks = forms.IntegerField(
        label=gettext_lazy("Weeks later"),
        min_value=0,
        max_value=520,
        initial=26,
        help_text=gettext_lazy("The same day of the week and time of day. You can change each afterwards."),
    )

    def __init__(self, *args: Any, groups: list[RacerGroup], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        choices = [("", _("a new class")), *((group.slug, group.name) for group in groups)]
        self.fields["to_group"].choices = choices  # type: ignore[attr-defined]

    def clean(self) -> dict[str, object]:
        """A new class needs a name."""
        cleaned = super().clean() or {}
        if not cleaned.get("to_group") and not cleaned.get("name"):
            self.add_error("name", _("Enter a name for the new class, or choose where to copy to."))
        return cleaned


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def assignments_copy(request: HttpRequest, slug: str) -> HttpResponse:
    """Copy all assignments of a group, without its students, to another or to a new class."""
    taught = list(groups_taught_by(request.user).select_related("classroom").order_by("name"))
    group = next((one for one in taught if one.slug == slug), None)
    if group is None:
        raise Http404
    by, now, once = racer_of(request), timezone.now(), request.POST.get("once", "")
    form = CopyAssignmentsForm(request.POST or None, groups=[one for one in taught if one != group])
    if request.method == "POST" and form.is_valid():
        if not form_nonce.claim(once):
            return redirect("assignments")
        chosen = form.cleaned_data
        with faults_shown(form, nonce=once):
            target = next((one for one in taught if one.slug == chosen["to_group"]), None)
            shift = timedelta(weeks=chosen["weeks"])
            with transaction.atomic():
                if target is None:
                    plan = getattr(getattr(group, "classroom", None), "plan", [])
                    target = make_class(teacher=by, name=chosen["name"], plan=plan, now=now).group
                copies = services.copy_assignments(from_group=group, to_group=target, by=by, now=now, shift=shift)
            done = _("Drafts created in %(group)s: %(count)s.") % {"count": len(copies), "group": target.name}
            messages.success(request, done)
            return redirect("assignments")
    context = {
        "group": group,
        "form": form,
        "assignments": Assignment.objects.filter(group=group),
        "once": form_nonce.new_nonce(),
    }
    return render(request, "courses/assignments/copy.html", context, status=422 if form.errors else 200)

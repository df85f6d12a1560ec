"""A student's assignments, an assignment with its attempts, an attempt; for teachers refunds and exceptions."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.exceptions import ValidationError
from django.db.models import Case, Count, Q, Value, When
from django.http import HttpRequest, HttpResponse, HttpResponseRedirect
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.forms import number_sent
from core.pages.faults import faults_reported, report_fault
from evaluation.garage.selectors import cars_of, shared_models
from evaluation.models import TrainedModel
from evaluation.selectors import models_of
from paddock.errors import UserFault

from ..assignments import services as assigning
from ..assignments.forms import ExtensionForm, ReferenceForm, SubmissionGroupForm, show_fault
from ..assignments.selectors import assignments_taught_by, assignments_visible_to
from ..assignments.students import Student, names_of, students_named
from ..assignments.views import taught_assignment
from ..assignments.wording import pass_rule_sentence
from ..grading.members import groups_taught_by, taught_by, unit_of, unit_of_attempt
from ..grading.services import deadline_of
from ..models import Assignment, Extension, Mark, ReferenceRow
from . import services
from .overview import handed_in_by, task_of, tasks_of
from .pages import attempt_rows, board_of, parts_of, shown_tracks
from .selectors import attempts_visible_to, with_runs


@login_required
@never_cache
@require_safe
def assignments(request: HttpRequest) -> HttpResponse:
    """What the reader has to hand in, and the assignments that they teach."""
    racer, now = racer_of(request), timezone.now()
    taught = (
        assignments_taught_by(racer)
        .annotate(
            parts_count=Count("parts", distinct=True),
            tried=Count("attempts__racer", filter=Q(attempts__is_reference=False), distinct=True),
        )
        .order_by("-due_at", "-pk")
    )
    tasks = tasks_of(racer, handed_in_by(racer), now)
    context = {
        "tasks": tasks,
        "taught": taught,
        "teaches": bool(taught) or (not tasks and groups_taught_by(racer).exists()),
        "now": now,
    }
    return render(request, "courses/attempts/list.html", context)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def assignment(request: HttpRequest, public_id: str) -> HttpResponse:
    """An assignment: for its students with their attempts and a form to hand in, for teachers as students see it."""
    racer, now = racer_of(request), timezone.now()
    found = assignments_visible_to(racer).select_related("group__classroom")
    teaches = Case(When(taught_by(racer, "group"), then=Value(True)), default=Value(False))
    shown: Assignment = get_object_or_404(found.annotate(is_taught=teaches), public_id=public_id)
    is_taught: bool = shown.is_taught  # type: ignore[attr-defined]
    if request.method == "POST" and not is_taught:
        return _hand_in(request, shown, racer)
    parts = parts_of(shown)
    full = sum((part.points for part in parts), Decimal())
    context: dict[str, object] = {
        "assignment": shown,
        "is_teacher": is_taught,
        "parts": [(part, pass_rule_sentence(part.pass_rule, part.pass_params), shown_tracks(part)) for part in parts],
        "full": full,
    }
    unit = None
    if not is_taught:
        unit = unit_of(shown, racer)
        attempts = list(with_runs(unit.attempts(shown)))
        mark = Mark.objects.filter(assignment=shown, racer=racer).first()
        due_at, last_at = deadline_of(shown, unit)
        extension = (
            Extension(due_at=due_at, last_at=last_at) if (due_at, last_at) != (shown.due_at, shown.last_at) else None
        )
        kept = [one.accepted_at for one in attempts if one.refunded_at is None]
        rows = attempt_rows(shown, attempts, mark, due_at)
        task = task_of(shown, kept, mark, extension, now, full, len(parts))
        latest = {row.attempt.model_id for row in rows[:1] if row.attempt.refunded_at is None}
        context |= {"task": task, "rows": rows, "mark": mark, "unit": unit, "waits": any(row.waits for row in rows)}
        context["fellows"] = Racer.objects.filter(pk__in=unit.racers if unit.group else ()).order_by("alias")
        context["models"] = [one for one in models_of(racer) if one.pk not in latest] if task.takes_attempts else []
    context["board"] = board_of(shown, unit)
    return render(request, "courses/attempts/assignment.html", context)


def _hand_in(request: HttpRequest, shown: Assignment, racer: Racer) -> HttpResponse:
    """Submit a model from the garage."""
    model = models_of(racer).filter(public_id=request.POST.get("model", "")).first()
    with faults_reported(request):
        if model is None:
            raise UserFault("model_not_yours")
        services.submit_attempt(assignment=shown, racer=racer, model=model, now=timezone.now())
        messages.success(request, _("Handed in. The runs appear below."))
        return HttpResponseRedirect(f"{shown.get_absolute_url()}#attempts")
    return HttpResponseRedirect(f"{shown.get_absolute_url()}#send")


@login_required
@never_cache
@require_safe
def attempt(request: HttpRequest, public_id: str) -> HttpResponse:
    """One attempt with its runs and its marks; a teacher can give it back."""
    racer = racer_of(request)
    shown = get_object_or_404(with_runs(attempts_visible_to(racer)), public_id=public_id)
    of = get_object_or_404(assignments_visible_to(racer).select_related("group__classroom"), pk=shown.assignment_id)
    unit = unit_of_attempt(shown)
    mark = Mark.objects.filter(assignment=of, racer__in=unit.racers).first()
    due_at, _last_at = deadline_of(of, unit)
    is_teacher = assignments_taught_by(racer).filter(pk=of.pk).exists()
    students = students_named(of.group, [shown.racer_id]) if is_teacher else []
    context = {
        "assignment": of,
        "is_teacher": is_teacher,
        "attempt": shown,
        "row": attempt_rows(of, [shown], mark, due_at)[0],
        "student": names_of(students).get(shown.racer_id, shown.racer.shown_name),
        "due_at": due_at,
    }
    return render(request, "courses/attempts/attempt.html", context)


@login_required
@require_POST
def attempt_refund(request: HttpRequest, public_id: str) -> HttpResponse:
    """Give an attempt back, with a reason that its student sees."""
    taught = attempts_visible_to(request.user).filter(taught_by(racer_of(request), "assignment__group"))
    shown = get_object_or_404(taught, public_id=public_id)
    reason = " ".join(request.POST.get("reason", "").split())[:200]
    if not reason:
        messages.error(request, _("Enter a reason: the student sees it."))
        return redirect(shown)
    with faults_reported(request):
        services.refund_attempt(attempt=shown, by=racer_of(request), reason=reason, now=timezone.now())
        messages.success(request, _("Given back. It counts for no limit and no mark."))
    return redirect(shown)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def assignment_students(request: HttpRequest, public_id: str) -> HttpResponse:
    """Extensions, submission groups and reference rows of an assignment."""
    shown, by = taught_assignment(request, public_id), racer_of(request)
    do = request.POST.get("do", "")
    extensions = list(Extension.objects.filter(assignment=shown).select_related("racer", "granted_by"))
    students = students_named(shown.group, [one.racer_id for one in extensions])
    choices = [(one.racer.alias, one.name) for one in students]
    data = request.POST or None
    extension = ExtensionForm(data if do == "extend" else None, assignment=shown, students=choices)
    grouping = SubmissionGroupForm(data if do == "group" else None, students=choices)
    reference = ReferenceForm(data if do == "reference" else None, cars=cars_of(by))
    form = {"extend": extension, "group": grouping, "reference": reference}.get(do)
    if request.method == "POST" and (form is None or form.is_valid()):
        try:
            _except(request, shown, by, students, form.cleaned_data if form else {})
        except (UserFault, ValidationError) as fault:
            if form is None:
                report_fault(request, fault) if isinstance(fault, UserFault) else None
            elif isinstance(fault, UserFault):
                show_fault(form, fault)
            else:
                form.add_error(None, fault.messages)
        if form is None or not form.errors:
            return redirect("assignment_students", shown.public_id)
    groups = shown.submission_groups.prefetch_related("members")
    known = {one.racer.pk for one in students}
    others = [member.racer_id for group in groups for member in group.members.all() if member.racer_id not in known]
    context = {
        "assignment": shown,
        "is_teacher": True,
        "extensions": extensions,
        "groups": groups,
        "references": ReferenceRow.objects.filter(assignment=shown).select_related("attempt"),
        "names": names_of(students_named(shown.group, others) if others else students),
        "extension": extension,
        "grouping": grouping,
        "reference": reference,
    }
    wrong = form is not None and bool(form.errors)
    return render(request, "courses/assignments/students.html", context, status=422 if wrong else 200)


def _except(request: HttpRequest, shown: Assignment, by: Racer, students: list[Student], sent: dict[str, Any]) -> None:
    """Do what a form of the page of exceptions asks for. Raises UserFault and ValidationError."""
    do, now = request.POST.get("do", ""), timezone.now()
    by_alias = {one.racer.alias: one.racer for one in students}
    if do == "extend":
        given = {name: sent[name] for name in ("due_at", "last_at", "reason")}
        assigning.extend(assignment=shown, racer=by_alias[sent["racer"]], by=by, now=now, **given)
    elif do == "end-extension" and (racer := by_alias.get(request.POST.get("racer", ""))):
        assigning.end_extension(assignment=shown, racer=racer, by=by, now=now)
    elif do == "group":
        racers = [by_alias[alias] for alias in sent["racers"]]
        assigning.make_submission_group(assignment=shown, by=by, name=sent["name"], racers=racers, now=now)
    elif do == "ungroup":
        group = get_object_or_404(
            shown.submission_groups.select_related("assignment__group"), pk=number_sent(request, "group")
        )
        assigning.delete_submission_group(group=group, by=by, now=now)
    elif do == "reference":
        mine = TrainedModel.objects.filter(
            Q(pk__in=models_of(by).values("pk")) | Q(pk__in=shared_models(by).values("pk"))
        )
        model = get_object_or_404(mine, public_id=sent["model"])
        services.add_reference(assignment=shown, by=by, label=sent["label"], model=model, now=now)
    elif do == "remove-reference":
        row = get_object_or_404(ReferenceRow.objects.filter(assignment=shown), pk=number_sent(request, "row"))
        services.remove_reference(assignment=shown, row=row, by=by)
    else:
        return
    messages.success(request, _("Saved."))

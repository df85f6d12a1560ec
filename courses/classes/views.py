"""The teacher's pages, printable cards, and log-in by code."""

from typing import Any

import segno
from django import forms
from django.contrib import messages
from django.contrib.auth import login
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.safestring import mark_safe
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_post_parameters
from django.views.decorators.http import require_http_methods, require_POST

from accounts.class_accounts import services
from accounts.models import ClassLearner, Classroom
from accounts.request_racer import racer_of
from accounts.usage.selectors import usage_of
from core.addresses import origin_of
from core.forms import add_fault, explain
from core.pages import form_nonce
from core.pages.faults import faults_reported, faults_shown
from paddock.errors import UserFault
from races.entries.selectors.visibility import races_visible_to
from races.spoilers.selectors import spoilers_of
from training.lessons.catalogue import BY_SLUG, LESSONS

from ..grading.members import groups_taught_by
from ..marks.views import marks_are_downloaded
from .deletion import delete_class, delete_group_assignments, has_marks, remove_learner
from .selectors import progress_of, series_of


class ClassForm(forms.Form):
    name = forms.CharField(label=gettext_lazy("Name"), max_length=64)
    plan = forms.MultipleChoiceField(
        label=gettext_lazy("Lesson plan"), required=False, widget=forms.CheckboxSelectMultiple
    )

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        plan = self.fields["plan"]
        assert isinstance(plan, forms.MultipleChoiceField)
        plan.choices = [(lesson.slug, lesson.title) for lesson in LESSONS]
        plan.initial = [lesson.slug for lesson in LESSONS]


class NamesForm(forms.Form):
    names = forms.CharField(
        label=gettext_lazy("Names"),
        widget=forms.Textarea(attrs={"rows": 6, "autocomplete": "off"}),
        max_length=20_000,
        help_text=gettext_lazy(
            "One per line. Only you see the names; others see a random alias. A student ID for Moodle or Canvas may "
            "follow a semicolon: Jo Miller; 20261234"
        ),
    )


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def classrooms(request: HttpRequest) -> HttpResponse:
    form, once = ClassForm(request.POST or None), request.POST.get("once", "")
    if request.method == "POST" and form.is_valid():
        if not form_nonce.claim(once):
            return redirect("classrooms")  # it is in the list
        with faults_shown(form, nonce=once):
            made = services.make_class(teacher=racer_of(request), now=timezone.now(), **form.cleaned_data)
            messages.success(request, _("Class created. Add its learners."))
            return redirect(made)
    taught = services.classes_taught_by(request.user)
    context = {"classes": taught, "form": form, "once": form_nonce.new_nonce()}
    return render(request, "courses/classes/list.html", context, status=422 if form.errors else 200)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def classroom(request: HttpRequest, slug: str) -> HttpResponse:
    """A class for its teachers. POST changes it; new codes are on cards to print, which appear only once."""
    shown = get_object_or_404(services.classes_taught_by(request.user), group__slug=slug)
    by, do = racer_of(request), request.POST.get("do", "")
    names, once = NamesForm(request.POST if do == "add" else None), request.POST.get("once", "")
    only = [int(pk) for pk in request.POST.getlist("learner") if pk.isdecimal() and len(pk) < 18]
    if do == "codes" and not only:  # before the form counts as sent: the next click may be of this very one
        messages.error(request, _("Select learners for new codes."))
        return redirect(shown)
    if do in ("add", "codes", "all-codes") and not form_nonce.claim(once):
        messages.info(request, _("This was done already. Make new codes to print cards again."))
        return redirect(shown)
    try:
        if do == "add" and names.is_valid():
            wanted = services.names_in(names.cleaned_data["names"])
            cards = services.add_learners(classroom=shown, by=by, names=wanted, now=timezone.now())
            return _cards(request, shown, cards)
        if do in ("codes", "all-codes"):
            ticked = only if do == "codes" else None
            return _cards(request, shown, services.new_codes(classroom=shown, by=by, learners=ticked))
        if do == "ids":
            ids = {pk: request.POST.get(f"id-{pk}", "") for pk in only}
            services.set_student_ids(classroom=shown, by=by, ids=ids)
            messages.success(request, _("Saved."))
            return redirect(shown)
        if do == "plan":
            plan = [lesson.slug for lesson in LESSONS if lesson.slug in request.POST.getlist("plan")]
            services.change_plan(classroom=shown, by=by, plan=plan)
            messages.success(request, _("Saved."))
            return redirect(shown)
        if do in ("add-teacher", "remove-teacher"):
            return _change_teachers(request, shown, do)
        if do == "take-out":
            learners = list(shown.learners.select_related("racer").filter(racer__in=only))
            if not learners or "sure" not in request.POST:
                messages.error(request, _("Tick the learners, and confirm that their accounts are deleted."))
                return redirect(shown)
            for learner in learners:
                remove_learner(classroom=shown, by=by, racer=learner.racer)
                messages.success(request, _("%(name)s is out of the class.") % {"name": learner.real_name})
            return redirect(shown)
        if do == "delete":
            if request.POST.get("confirm") != shown.group.name:
                messages.error(request, _("Write the name of the class to delete it."))
                return redirect(shown)
            delete_class(classroom=shown, by=by, marks_exported=marks_are_downloaded(request, shown.group))
            messages.success(request, _("Class deleted with all its content."))
            return redirect("classrooms")
    except UserFault as fault:
        form_nonce.release(once)
        add_fault(names, fault) if names.is_bound else messages.error(request, explain(fault))
    context = {
        "classroom": shown,
        "leads": services.can_lead_class(by, shown),
        "teachers": shown.teachers.select_related("racer"),
        "rows": progress_of(shown),
        "series": series_of(shown, timezone.now(), spoilers_of(request).hidden),
        "races": races_visible_to(request.user).filter(group=shown.group),
        "form": names,
        "once": form_nonce.new_nonce(),
        "plan": ClassForm(initial={"name": shown.group.name, "plan": shown.plan}),
        "has_marks": has_marks(shown.group),
        "usage": usage_of(shown.group.leader or by, timezone.now(), only=[services.LEARNERS.name]),
    }
    return render(request, "courses/classes/class.html", context, status=422 if names.errors else 200)


@login_required
@require_POST
def group_assignments_delete(request: HttpRequest, slug: str) -> HttpResponse:
    """At the end of a term: delete all assignments of a group, once their marks were downloaded."""
    group = get_object_or_404(groups_taught_by(request.user), slug=slug)
    if request.POST.get("confirm", "").strip() != group.name:
        messages.error(request, _("Write the name of the group to delete its assignments."))
        return redirect(group)
    with faults_reported(request):
        exported = marks_are_downloaded(request, group)
        delete_group_assignments(group=group, by=racer_of(request), marks_exported=exported)
        messages.success(request, _("All assignments deleted."))
    return redirect(group)


def _change_teachers(request: HttpRequest, shown: Classroom, do: str) -> HttpResponse:
    by, alias = racer_of(request), request.POST.get("alias", "")
    if do == "add-teacher":
        teacher = services.add_teacher(classroom=shown, by=by, alias=alias, now=timezone.now())
        messages.success(request, _("%(alias)s teaches the class, too.") % {"alias": teacher.racer.alias})
        return redirect(shown)
    teacher = get_object_or_404(shown.teachers.select_related("racer"), racer__alias=alias)
    services.remove_teacher(classroom=shown, by=by, racer=teacher.racer)
    messages.success(request, _("%(alias)s no longer teaches the class.") % {"alias": teacher.racer.alias})
    return redirect("classrooms" if teacher.racer_id == by.pk else shown)


def _cards(request: HttpRequest, shown: Any, cards: list[services.Card]) -> HttpResponse:
    origin = origin_of(request)
    rows = []
    for card in cards:
        link = f"{origin}{reverse('class_code', args=[card.code])}"
        drawn = segno.make(link, error="m").svg_inline(scale=3, border=2, omitsize=True, svgclass="qr", lineclass="")
        rows.append((card.learner, services.shown_code(card.code), mark_safe(drawn)))
    context = {"classroom": shown, "cards": rows, "address": f"{origin}{reverse('class_log_in')}"}
    return render(request, "courses/classes/cards.html", context)


@sensitive_post_parameters("code")
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def class_log_in(request: HttpRequest, code: str = "") -> HttpResponse:
    """Log a learner in by a card's code, which the card's QR code fills in; show the tasks of the class."""
    problem = ""
    if request.method == "POST":
        try:
            racer = services.learner_with(request, request.POST.get("code", ""))
        except UserFault as fault:
            problem = explain(fault)
        else:
            if racer is not None:
                login(request, racer, backend="django.contrib.auth.backends.ModelBackend")
                return redirect("class_log_in")
            problem = _("Unknown code. Check it, or ask your teacher for a new one.")
    mine = None
    if request.user.is_authenticated and not code:
        mine = ClassLearner.objects.filter(racer=request.user).select_related("classroom__group").first()
    context: dict[str, object] = {"code": code, "problem": problem, "mine": mine}
    if mine is not None:
        context["plan"] = [(BY_SLUG[slug], slug in mine.lessons) for slug in mine.classroom.plan if slug in BY_SLUG]
        context["races"] = races_visible_to(request.user).filter(group=mine.classroom.group)
        context["series"] = series_of(mine.classroom, timezone.now(), spoilers_of(request).hidden)
    return render(request, "courses/classes/log_in.html", context, status=422 if problem else 200)

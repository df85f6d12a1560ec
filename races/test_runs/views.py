"""A racer's own runs: the list, the form, driving one again, deleting one."""

from collections.abc import Iterable
from functools import cache, partial
from operator import itemgetter
from typing import Any

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.template.loader import render_to_string
from django.utils import timezone
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.models import Racer
from accounts.quotas import Usage
from accounts.request_racer import racer_of
from accounts.usage.selectors import usage_of
from core.database.kept_queries import KeptQuery
from core.pages.faults import faults_reported, report_fault
from core.pages.pager import kept_pages
from core.streams.shared_pieces import filled, hole, shared_piece
from evaluation.models import Evaluation, State
from paddock.errors import UserFault
from paddock.rules.ranked import RANKED
from races.boards.ranking import Standing, standing_in
from races.entries.selectors.lists import open_races
from races.entries.selectors.visibility import races_visible_to
from races.models import OwnEvaluation, RaceType
from races.quotas import OWN_RUNS_A_DAY, OWN_RUNS_AT_ONCE
from races.test_runs.forms import AsInForm, OwnForm, own_preview, values_of, values_of_race, values_of_rivals
from races.test_runs.selectors import is_own_of, own_runs_of, seen_race_of, usable_race
from races.test_runs.services import delete_own, drive_own, drive_own_again, options_of

from ..web.views import visible_evaluation

PER_PAGE = 30
RACES_OFFERED = 60
# What the list shows of a run
_SHOWN = (
    *("asked_at", "owner_id", *RANKED),
    *(f"evaluation__{name}" for name in ("public_id", "state", "reason_code", "reason_params", "spec")),
    *("evaluation__track__name", "evaluation__model__name", "evaluation__model__owner__alias"),
    *("evaluation__result__laps", "race__slug", "race__name"),
)
# The tracks and models of a racer's own runs: slugs, names, ids, names
_DRIVEN = [f"evaluation__{name}" for name in ("track__slug", "track__name", "model__public_id", "model__name")]
_driven: KeptQuery[tuple[str, str, str, str]] = KeptQuery(
    lambda racer: (
        OwnEvaluation.objects.filter(owner_id=racer, deleted_at=None).order_by().values_list(*_DRIVEN).distinct()
    )
)


@login_required
@require_safe
def own_runs(request: HttpRequest) -> HttpResponse:
    """My runs, the latest first; by state, type of race, track and model."""
    racer, asked = racer_of(request), request.GET
    driven = _driven(racer=racer.pk)
    choices: dict[str, list[tuple[Any, Any]]] = {
        "state": list(State.choices),
        "race_type": list(RaceType.choices),
        "track": _by_name(row[:2] for row in driven),
        "model": _by_name(row[2:] for row in driven),
    }
    only = {name: asked[name] for name, known in choices.items() if asked.get(name) in dict(known)}
    first = None if only else partial(_newest(racer.is_staff), racer=racer.pk)
    page = kept_pages(asked.get("page"), PER_PAGE, first, lambda: own_runs_of(racer, **only).only(*_SHOWN))
    context = {
        "page": page,
        "rows": [(own, _worth(own), seen_race_of(own)) for own in page],
        "choices": choices,
        "only": only,
        "quotas": _quotas(racer),
    }
    return render(request, "races/test_runs/runs.html", context)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def own_new(request: HttpRequest) -> HttpResponse:
    """Form of a run: as in the ``race`` of the address, else with custom rules. ``model``, ``track`` prefill a field,
    ``like`` the rules of a race, ``run`` those of an own run."""
    racer = racer_of(request)
    try:
        race = usable_race(racer, request.GET["race"]) if "race" in request.GET else None
    except UserFault as fault:
        report_fault(request, fault)
        return redirect("own_new")
    form: AsInForm | OwnForm
    if race is not None:
        form = AsInForm(request.POST or None, racer=racer, initial=_named(request, "model"))
    else:
        form = OwnForm(request.POST or None, racer=racer, initial=_initial(request, racer))
    if request.method == "POST" and form.is_valid():
        try:
            arguments = form.service_arguments(racer) | ({"race": race} if race is not None else {})
            own = drive_own(owner=racer, now=timezone.now(), **arguments)
        except UserFault as fault:
            form.show(fault)
        else:
            assert own.evaluation is not None, "it has just been queued"
            return redirect(own.evaluation)
    context: dict[str, object] = {"form": form, "race": race, "quotas": _quotas(racer), "is_own": True}
    if isinstance(form, OwnForm):
        context["rule_fields"] = _rule_fields(form)
        context["races"] = open_races(timezone.now(), racer)[:RACES_OFFERED]
    return render(request, "races/test_runs/new.html", context, status=422 if form.errors else 200)


@login_required
@require_POST
def own_layout(request: HttpRequest) -> HttpResponse:
    """Preview of a form's layout, not saved: a map with its boxes, or its problems."""
    context = {"layout": own_preview(OwnForm(request.POST), submitted=False), "is_own": True}
    return render(request, "races/rules/layout.html", context)


@login_required
@require_POST
def own_again(request: HttpRequest, public_id: str) -> HttpResponse:
    """Drive a run of mine again."""
    own, evaluation = _mine(request, public_id)
    with faults_reported(request):
        evaluation = drive_own_again(own=own, now=timezone.now()).evaluation or evaluation
    return redirect(evaluation)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def own_delete(request: HttpRequest, public_id: str) -> HttpResponse:
    """Ask, then delete a run of mine that is over."""
    own, evaluation = _mine(request, public_id)
    if request.method == "POST":
        with faults_reported(request):
            delete_own(own=own, now=timezone.now())
            messages.success(request, _("Run deleted."))
            return redirect("own_runs")
        return redirect(evaluation)
    return render(request, "races/test_runs/delete.html", {"own": own, "evaluation": evaluation})


@cache
def _newest(is_staff: bool) -> KeptQuery[OwnEvaluation]:
    """The first page of all own runs, and one more."""
    return KeptQuery(lambda racer: own_runs_of(Racer(pk=racer, is_staff=is_staff)).only(*_SHOWN)[: PER_PAGE + 1])


def _mine(request: HttpRequest, public_id: str) -> tuple[OwnEvaluation, Evaluation]:
    evaluation = visible_evaluation(request, public_id)
    own: OwnEvaluation | None = getattr(evaluation, "own", None)
    if own is None or not is_own_of(request.user, own):
        raise Http404
    return own, evaluation


def _worth(own: OwnEvaluation) -> Standing | None:
    """The score of a run by its own ranking; None before it has a result."""
    result = getattr(own.evaluation, "result", None)
    return None if result is None else standing_in(own.as_race, result.laps)


def _quotas(racer: Racer) -> list[Usage]:
    """The used parts of the quotas for own runs."""
    wanted = (OWN_RUNS_AT_ONCE.name, OWN_RUNS_A_DAY.name)
    return usage_of(racer, timezone.now(), only=wanted)


def _rule_fields(form: OwnForm) -> SafeString:
    """The fields of track and rules: drawn once for all readers of the same values, with each one's cars as rivals."""
    template = "races/test_runs/rule_fields.html"
    rivals = render_to_string("races/test_runs/rivals.html", {"form": form})

    def context(shown: OwnForm, rivals: SafeString) -> dict[str, object]:
        return {"form": shown, "rivals": rivals, "layout": own_preview(shown, submitted=form.is_bound), "is_own": True}

    if form.is_bound:
        return render_to_string(template, context(form, rivals))
    shared = [name for name in OwnForm.base_fields if name != "model"]
    values = {name: form.get_initial_for_field(form.fields[name], name) for name in shared}
    piece = shared_piece(template, lambda: context(OwnForm(initial=values), hole("rivals")), key=repr(values))
    return filled(piece, rivals=rivals)


def _initial(request: HttpRequest, racer: Racer) -> dict[str, object]:
    """Initial values: of an own run or a race, then those in the address."""
    asked, initial = request.GET, {}
    wanted = asked.get("run")
    if run := own_runs_of(racer).filter(evaluation__public_id=wanted).first() if wanted else None:
        assert run.evaluation is not None, "it is in the list"
        rivals = run.evaluation.rivals.select_related("model").order_by("number")
        initial = values_of(options_of(run)) | {"track": run.evaluation.track.slug}
        initial |= {"model": run.evaluation.model.public_id} | values_of_rivals([each.model for each in rivals])
        if rivals:
            initial["opponents"] = "models"
    elif like := asked.get("like"):
        race = races_visible_to(racer).filter(slug=like, imported_at=None).first()
        initial = values_of_race(race) if race else {}
    return initial | _named(request, "model", "track")


def _named(request: HttpRequest, *names: str) -> dict[str, str]:
    return {name: request.GET[name][:80] for name in names if request.GET.get(name)}


def _by_name(choices: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    return sorted(set(choices), key=itemgetter(1))

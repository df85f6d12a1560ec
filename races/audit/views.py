"""Pages of the audit log."""

from django.contrib.auth.decorators import login_required
from django.core.exceptions import PermissionDenied
from django.db.models import QuerySet
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase, StreamingHttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from accounts.models import Racer, Viewer
from core.audit.acts import ACTS
from core.audit.models import AuditEntry

from ..models import Race
from ..web.views import organised_race
from .exports import FORMS
from .forms import AuditForm
from .selectors import AuditFilter, entries_visible_to, in_order, page_of, reads_all


@login_required
@never_cache
@require_safe
def audit(request: HttpRequest) -> HttpResponse:
    """The whole log, for admins."""
    _require(request.user)
    return _shown(request, entries_visible_to(request.user), None)


@login_required
@never_cache
@require_safe
def race_audit(request: HttpRequest, slug: str) -> HttpResponse:
    """What was done about a race, for its organisers."""
    race = organised_race(request, slug)
    return _shown(request, entries_visible_to(request.user).filter(race=race.pk), race)


@login_required
@never_cache
@require_safe
def audit_export(request: HttpRequest, form: str) -> HttpResponseBase:
    """The filtered log as a file, for admins."""
    _require(request.user)
    if form not in FORMS:
        raise Http404
    return exported(request.user, AuditForm(request.GET).filter(), form)


def exported(viewer: Viewer, wanted: AuditFilter, form: str) -> StreamingHttpResponse:
    """The log in one of :data:`~.exports.FORMS` as a download."""
    kind, lines = FORMS[form]
    name = f"audit-{timezone.now():%Y%m%d-%H%M%S}.{form}"
    return StreamingHttpResponse(
        lines(in_order(wanted(entries_visible_to(viewer)))),
        content_type=kind,
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


def _shown(request: HttpRequest, entries: QuerySet[AuditEntry], race: Race | None) -> HttpResponse:
    acts = ACTS if race is None else set(entries.order_by().values_list("action", flat=True).distinct())
    form = AuditForm(request.GET, acts=acts)
    wanted = form.filter()
    page = page_of(wanted(entries), before=form.cleaned_data.get("before"))
    context: dict[str, object] = {"form": form, "race": race, "page": page, "wanted": wanted, "forms": FORMS}
    context["rows"] = [(entry, ACTS.get(entry.action), page.races.get(entry.race or 0)) for entry in page.entries]
    context["in_full"] = reads_all(request.user)
    return render(request, "races/audit/log.html", context, status=200 if form.is_valid() else 422)


def _require(viewer: Viewer) -> None:
    if not (isinstance(viewer, Racer) and reads_all(viewer)):
        raise PermissionDenied

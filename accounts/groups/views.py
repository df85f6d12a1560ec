"""Pages of groups of racers."""

from django import forms
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.exceptions import ValidationError
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from core.addresses import origin_of
from core.pages.faults import faults_reported, faults_shown, report_fault
from core.pages.pager import LeanPaginator
from paddock.errors import UserFault

from ..models import RacerGroup
from ..request_racer import racer_of
from . import services
from .selectors import can_lead, groups_visible_to, members_visible_to, with_class

MEMBERS_PER_PAGE = 100


class GroupForm(forms.Form):
    name = forms.CharField(label=gettext_lazy("Name"), max_length=64)
    description = forms.CharField(
        label=gettext_lazy("Description"), required=False, max_length=500, widget=forms.Textarea(attrs={"rows": 3})
    )


@require_safe
def groups(request: HttpRequest) -> HttpResponse:
    page = LeanPaginator(groups_visible_to(request.user), MEMBERS_PER_PAGE).get_page(request.GET.get("page"))
    mine: dict[int, bool] = {}
    if request.user.is_authenticated:
        mine = {
            group: confirmed_at is not None
            for group, confirmed_at in request.user.group_memberships.values_list("group", "confirmed_at")
        }
    asked = {group for group, confirmed in mine.items() if not confirmed}
    return render(request, "accounts/groups/list.html", {"page": page, "mine": mine, "asked": asked})


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def group_new(request: HttpRequest) -> HttpResponse:
    form = GroupForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        with faults_shown(form):
            made = services.make_group(by=racer_of(request), now=timezone.now(), **form.cleaned_data)
            messages.success(request, _("Group created. Send its link to the members."))
            return redirect(made)
    return render(request, "accounts/groups/new.html", {"form": form}, status=422 if form.errors else 200)


@require_http_methods(["GET", "HEAD", "POST"])
def group(request: HttpRequest, slug: str) -> HttpResponse:
    """A group and its members. A POST by its leader performs the action of its button ``do`` on the racer ``racer``."""
    shown = get_object_or_404(groups_visible_to(request.user).select_related("classroom"), slug=slug)
    if request.method == "POST":
        return _do(request, shown)
    members = with_class(members_visible_to(request.user).filter(group=shown)).order_by("confirmed_at", "pk")
    leads = can_lead(request.user, shown)
    page = LeanPaginator(members.filter(confirmed_at__isnull=False), MEMBERS_PER_PAGE).get_page(request.GET.get("page"))
    mine = next((member for member in page if member.racer_id == request.user.pk), None)
    if mine is None and request.user.is_authenticated:
        mine = members.filter(racer=request.user.pk).first()
    context = {
        "group": shown,
        "page": page,
        "asking": members.filter(confirmed_at=None) if leads else (),
        "leads": leads,
        "is_class": hasattr(shown, "classroom"),
        "mine": mine,
        "link": f"{origin_of(request)}{reverse('group_join', args=[shown.code])}" if leads else "",
        "form": GroupForm(initial={"name": shown.name, "description": shown.description}),
    }
    return render(request, "accounts/groups/group.html", context)


@login_required
def _do(request: HttpRequest, shown: RacerGroup) -> HttpResponse:
    by, now, do = racer_of(request), timezone.now(), request.POST.get("do", "")
    try:
        if do == "change":
            form = GroupForm(request.POST)
            if not form.is_valid():
                messages.error(request, _("A group needs a name."))
                return redirect(shown)
            services.change_group(group=shown, by=by, **form.cleaned_data)
        elif do == "link":
            services.new_group_link(group=shown, by=by)
        elif do == "delete":
            services.delete_group(group=shown, by=by)
            messages.success(request, _("Group deleted."))
            return redirect("groups")
        else:
            alias = request.POST.get("racer", "")
            member = get_object_or_404(members_visible_to(by), group=shown, racer__alias=alias)
            if do == "confirm":
                services.confirm_member(member=member, by=by, now=now)
            elif do == "remove":
                services.remove_member(member=member, by=by)
            elif do == "hand_over":
                services.hand_over_group(group=shown, to=member.racer, by=by)
            else:
                raise Http404
    except UserFault as fault:
        report_fault(request, fault)
    except ValidationError as error:
        messages.error(request, " ".join(error.messages))
    else:
        messages.success(request, _("Saved."))
    seen = groups_visible_to(by).filter(pk=shown.pk).exists()
    return redirect(shown) if seen else redirect("groups")


@never_cache
@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def group_join(request: HttpRequest, code: str) -> HttpResponse:
    """The link of a group: what it is, and a button to ask to be in it."""
    found = RacerGroup.objects.filter(code=code).select_related("leader").first()
    if found is None:
        return render(request, "accounts/parts/no_link.html", status=404)
    if request.method == "POST":
        services.ask_to_join(code=code, racer=racer_of(request), now=timezone.now())
        return redirect(found)
    return render(request, "accounts/groups/join.html", {"group": found})


@login_required
@require_POST
def group_leave(request: HttpRequest, slug: str) -> HttpResponse:
    """Leave a group, or take back what was asked."""
    shown = get_object_or_404(groups_visible_to(request.user), slug=slug)
    member = racer_of(request).group_memberships.filter(group=shown).select_related("group").first()
    if member is not None:
        with faults_reported(request):
            services.remove_member(member=member, by=racer_of(request))
            messages.success(request, _("You are no longer in the group."))
            return redirect("groups")
        return redirect(shown)
    return redirect("groups")

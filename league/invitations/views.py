"""Pages of invitations by e-mail: the organiser's list, the personal link, and the link that stops invitations."""

from django import forms
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone, translation
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.http import require_http_methods

from accounts.request_racer import racer_of
from accounts.usage.selectors import usage_of
from core.forms import number_sent
from core.mail import mail_is_sent
from core.pages.faults import faults_reported, faults_shown
from core.pages.pager import LeanPaginator
from league.invitations import services as inviting
from league.models import MailInvitation
from paddock.errors import UserFault
from races.boards.ranking import rule_for
from races.models import Race
from races.web.views import organised_race

ROWS = 100
MOST_KB = 256
MOST_LINES = 500


class InvitingForm(forms.Form):
    addresses = forms.CharField(
        label=gettext_lazy("Addresses"),
        required=False,
        max_length=MOST_KB * 1024,
        widget=forms.Textarea(attrs={"rows": 6}),
        help_text=gettext_lazy("One a line, or separated by commas; names beside them are left out."),
    )
    file = forms.FileField(label=gettext_lazy("Or a CSV file with them"), required=False)

    def lines(self) -> list[inviting.AddressLine]:
        """All that was sent. Raises UserFault("invited_file")."""
        lists = {_("Addresses"): self.cleaned_data["addresses"]}
        file = self.cleaned_data["file"]
        if file is not None:
            content = file.read(MOST_KB * 1024 + 1)
            try:
                if len(content) > MOST_KB * 1024:
                    raise ValueError("too long")
                lists[_("CSV file")] = content.decode("utf-8-sig")
            except ValueError:
                raise UserFault("invited_file", limit_kb=MOST_KB) from None
        return inviting.read_addresses(lists)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_invited(request: HttpRequest, slug: str) -> HttpResponse:
    """The addresses invited to a race. A POST with ``look`` shows the list as it is read, with ``invite`` invites
    its addresses and marks other lines, with ``again`` or ``withdraw`` changes one invitation."""
    race, now = organised_race(request, slug), timezone.now()
    sent = request.method == "POST" and ("invite" in request.POST or "look" in request.POST)
    form = InvitingForm(request.POST if sent else None, request.FILES or None)
    if request.method == "POST" and not sent:
        return _change(request, slug)
    lines: list[inviting.AddressLine] = []
    addresses: list[str] = []
    if sent and form.is_valid():
        with faults_shown(form):
            lines = form.lines()
            addresses = inviting.addresses_of(lines)
            if "invite" in request.POST:
                _invite(request, race, addresses)
                if not any(line.is_wrong for line in lines):
                    return redirect("race_invited", race.slug)
                lines, addresses = [line for line in lines if line.is_wrong], []
                form = InvitingForm(initial={"addresses": "\n".join(line.text for line in lines)})
    invited = MailInvitation.objects.filter(race=race).select_related("accepted_by")
    page = LeanPaginator(invited, ROWS).get_page(request.GET.get("page"))
    context = {
        "race": race,
        "form": form,
        "lines": lines[:MOST_LINES],
        "wrong": sum(line.is_wrong for line in lines),
        "addresses": addresses,
        "is_sent": bool(lines) and not form.is_bound,
        "page": page,
        "rows": [(one, one.standing_at(now)) for one in page],
        "accepted": invited.filter(accepted_at__isnull=False).count(),
        "usage": usage_of(racer_of(request), now, only=[inviting.INVITED_A_DAY.name]),
    }
    refused = form.errors or context["is_sent"]
    return render(request, "league/invitations/invited.html", context, status=422 if refused else 200)


def _invite(request: HttpRequest, race: Race, addresses: list[str]) -> None:
    language = translation.get_language() or "en"
    number = inviting.invite_by_mail(
        race=race, by=racer_of(request), addresses=addresses, language=language, now=timezone.now()
    )
    if mail_is_sent():
        text = ngettext("%(n)s address is invited.", "%(n)s addresses are invited.", number)
    else:
        text = ngettext(
            "%(n)s invitation is written to a file only: this site has no mail server.",
            "%(n)s invitations are written to files only: this site has no mail server.",
            number,
        )
    messages.add_message(request, messages.SUCCESS if mail_is_sent() else messages.WARNING, text % {"n": number})


def _change(request: HttpRequest, slug: str) -> HttpResponse:
    race, now, by = organised_race(request, slug), timezone.now(), racer_of(request)
    do = "again" if "again" in request.POST else "withdraw"
    invited = MailInvitation.objects.filter(race=race).select_related("race")
    one = get_object_or_404(invited, pk=number_sent(request, do))
    with faults_reported(request):
        if do == "again":
            inviting.invite_again(invitation=one, by=by, now=now)
            messages.success(request, _("New invitation sent. The previous link no longer works."))
        else:
            inviting.withdraw_invitation(invitation=one, by=by, now=now)
            messages.success(request, _("Invitation withdrawn."))
    return redirect("race_invited", race.slug)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def invited(request: HttpRequest, token: str) -> HttpResponse:
    """Where a personal link leads: what the race is, and a button to join it, after a log-in."""
    now = timezone.now()
    found = inviting.invitation_of(token, now)
    if found is None:
        return render(request, "races/pages/invitation.html", {"race": None}, status=404)
    race = found.race
    if request.method == "POST":
        if not request.user.is_authenticated:
            way = "account_signup" if request.POST.get("with") == "signup" else "account_login"
            return redirect(f"{reverse(way)}?next={request.path}")
        terms = request.POST.get("terms", "")
        with faults_reported(request):
            inviting.accept_mail_invitation(
                token=token, racer=racer_of(request), now=now, terms=int(terms) if terms.isdecimal() else None
            )
            messages.success(request, _("You have joined. Submit a car."))
            return redirect(race)
        return redirect(request.path)
    context = {"race": race, "state": race.state_at(now), "ranking_rule": rule_for(race).rule(race)}
    return render(request, "races/pages/invitation.html", context)


@csrf_exempt  # mail programs post here without a cookie (RFC 8058); the signed token is the permission
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def invited_stop(request: HttpRequest, token: str) -> HttpResponse:
    """No more invitations to an address, by the link in one of them: looking asks, a POST does it."""
    address = inviting.stopped_address(token)
    if address is None:
        raise Http404
    if request.method == "POST":
        inviting.stop_invitations(email=address, now=timezone.now())
    return render(request, "league/invitations/stop.html", {"address": address, "done": request.method == "POST"})

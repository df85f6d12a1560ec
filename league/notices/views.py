"""Pages of a racer's notices and notice settings."""

from typing import Any

from django import forms
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import get_language_info, gettext_lazy
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.request_racer import racer_of
from core.forms import say_saved
from core.pages.pager import LeanPaginator
from league.notices.kinds import KINDS
from league.notices.selectors import notices_of
from league.notices.services import choice_of, choose_notices, mark_read, stop_mails, what_stops

ROWS = 30


class NoticesForm(forms.Form):
    """A box in the site and one by e-mail for each kind, and the language of e-mails."""

    language = forms.ChoiceField(
        label=gettext_lazy("Language of e-mails"),
        choices=[(code, get_language_info(code)["name_local"]) for code in ("en", "ko")],
    )

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for kind in KINDS.values():
            for way, label in (("site", _("on the site")), ("mail", _("by e-mail"))):
                box = forms.BooleanField(required=False, label=f"{kind.label}: {label}")
                box.widget.attrs["aria-label"] = box.label
                self.fields[f"{way}_{kind}"] = box

    def rows(self) -> list[tuple]:
        return [(kind.label, self[f"site_{kind}"], self[f"mail_{kind}"]) for kind in KINDS.values()]

    def off(self, way: str) -> list[str]:
        return [name for name in KINDS if not self.cleaned_data[f"{way}_{name}"]]


@login_required
@never_cache
@require_safe
def notices_bell(request: HttpRequest) -> HttpResponse:
    """The bell in the head of a page, for a page that stands open."""
    return render(request, "league/notices/parts/bell.html")


@login_required
@never_cache
@require_safe
def notices(request: HttpRequest) -> HttpResponse:
    own = notices_of(request.user)
    page = LeanPaginator(own, ROWS).get_page(request.GET.get("page"))
    return render(request, "league/notices/list.html", {"page": page, "unread": own.filter(read_at=None).exists()})


@login_required
@require_POST
def notices_read(request: HttpRequest) -> HttpResponse:
    mark_read(racer=racer_of(request), now=timezone.now())
    return redirect("notices")


@login_required
@require_POST
def notice_open(request: HttpRequest, pk: int) -> HttpResponse:
    notice = get_object_or_404(notices_of(request.user), pk=pk)
    mark_read(racer=racer_of(request), now=timezone.now(), notice=notice.pk)
    return redirect(notice.path or "notices")


@csrf_exempt  # mail programs post here without a cookie (RFC 8058); the signed token is the permission
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def notices_stop(request: HttpRequest, token: str) -> HttpResponse:
    """Turn e-mails of one kind off by the link in one of them: looking asks, a POST does it."""
    found = what_stops(token)
    if found is None:
        raise Http404
    racer, kind = found
    if request.method == "POST":
        stop_mails(racer=racer, kind=kind)
    return render(request, "league/notices/stop.html", {"kind": kind, "done": request.method == "POST"})


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def notice_settings(request: HttpRequest) -> HttpResponse:
    chosen = choice_of(racer_of(request))
    initial: dict[str, bool | str] = {"language": chosen.language}
    for kind in KINDS:
        initial |= {f"site_{kind}": kind not in chosen.site_off, f"mail_{kind}": kind not in chosen.mail_off}
    form = NoticesForm(request.POST or None, initial=initial)
    if request.method == "POST" and form.is_valid():
        language = form.cleaned_data["language"]
        choose_notices(racer=racer_of(request), site_off=form.off("site"), mail_off=form.off("mail"), language=language)
        say_saved(request, form)
        return redirect("notice_settings")
    return render(request, "league/notices/settings.html", {"form": form})

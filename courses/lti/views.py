"""Pages of LTI: log-in and launch by a platform, arrival of its people, and the set-up for admins and teachers."""

import secrets
from collections.abc import Callable
from functools import wraps
from typing import Any
from urllib.parse import urlencode, urlsplit

from django.conf import settings
from django.contrib import messages
from django.contrib.auth import login
from django.contrib.auth.decorators import login_required
from django.core.cache import cache
from django.core.exceptions import PermissionDenied
from django.db.models import Count, Max, Prefetch, Q, QuerySet
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.debug import sensitive_post_parameters
from django.views.decorators.http import require_GET, require_http_methods, require_POST

from accounts.class_accounts.services import classes_taught_by
from accounts.models import Classroom, Racer
from accounts.request_racer import racer_of
from core.forms import explain, number_sent
from core.rate_limits import address_of, count
from paddock.errors import PaddockError, UserFault

from ..models import LtiContext, LtiLine, LtiPlatform, LtiScore, LtiScoreState
from . import scores, services
from .frames import framed
from .launches import Launch
from .tool import tool_addresses, tool_configuration

View = Callable[..., HttpResponse]
ARRIVAL_S = 600
RATE = "1200/m"  # from one address, which a whole university may share
COOKIE = "lti-arrival"


def refused_in_words(view: View) -> View:
    """A view that shows its faults as a page with the reason."""

    @wraps(view)
    def inner(request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponse:
        try:
            return view(request, *args, **kwargs)
        except PaddockError as fault:
            context = {"code": fault.code, "reason": explain(fault)}
            return framed(render(request, "courses/lti/refused.html", context, status=fault.reason.status))

    return inner


@csrf_exempt
@never_cache
@require_http_methods(["GET", "POST"])
@refused_in_words
def begin(request: HttpRequest) -> HttpResponse:
    """A platform asks for a log-in. Our pages are shown in no frame: within one only a button is, except on the way to
    the choice of an assignment, which platforms show so."""
    from .library import PARAMETERS, log_in

    _count(request)
    wanted = request.GET.get("target_link_uri") or request.POST.get("target_link_uri") or ""
    chooses = urlsplit(wanted).path == reverse("lti_choose")
    if request.headers.get("Sec-Fetch-Dest") in ("iframe", "frame") and not chooses:
        # a link: a form may lead to this site only, not even by a redirect
        sent = {name: request.GET.get(name) or request.POST.get(name) for name in PARAMETERS}
        address = f"{request.path}?{urlencode({name: value for name, value in sent.items() if value})}"
        return framed(render(request, "courses/lti/new_window.html", {"address": address}))
    return log_in(request, request.build_absolute_uri(reverse("lti_launch")))


@csrf_exempt
@sensitive_post_parameters("id_token")
@never_cache
@require_POST
@refused_in_words
def launch(request: HttpRequest) -> HttpResponse:
    """A platform's token. The person goes on with a request of our own, which bears the cookies of our session."""
    from .deep_links import choice
    from .launches import read_launch
    from .library import checked_message

    _count(request)
    platform, message = checked_message(request)
    came = read_launch(platform, message)
    if message.is_deep_link_launch():
        return choice(request, came, message)
    if not message.is_resource_launch():
        raise UserFault("lti_message")
    key = secrets.token_urlsafe(24)
    cache.set(_key(key), came.kept(), ARRIVAL_S)
    answer = redirect("lti_arrival")
    answer.status_code = 303
    answer.set_cookie(
        COOKIE, key, ARRIVAL_S, path=reverse("lti_arrival"), secure=settings.BEHIND_HTTPS, httponly=True, samesite="Lax"
    )
    return answer


@never_cache
@require_http_methods(["GET", "POST"])
@refused_in_words
def arrival(request: HttpRequest) -> HttpResponse:
    """Log the person of a launch in, with their account here; ask where there is a choice: of the account, and
    a teacher for the class. Ends on the assignment."""
    key = request.COOKIES.get(COOKIE, "")
    kept = cache.get(_key(key)) if key else None
    if kept is None:
        raise UserFault("lti_expired")
    came = Launch(**kept)
    get_object_or_404(LtiPlatform, pk=came.platform, is_active=True)
    context, do = services.context_of(came), request.POST.get("do", "")
    if context is None and not came.is_teacher:
        raise UserFault("lti_no_class")
    racer = services.account_of(came, context) or _chosen(request, came, context, do)
    if racer is None:
        return _ask(request, came, step="account")
    if not services.may_enter(racer):
        raise UserFault("lti_account")
    if context is None:
        if do not in ("class", "new-class"):
            return _ask(request, came, step="class", classes=_led_by(racer))
        taught = get_object_or_404(_led_by(racer), pk=number_sent(request, "class")) if do == "class" else None
        context = services.link_course(launch=came, racer=racer, classroom=taught, now=timezone.now())
    if not cache.delete(_key(key)):  # used up, by this very browser
        raise UserFault("lti_expired")
    assignment = services.enter_course(launch=came, context=context, racer=racer, now=timezone.now())
    if request.user != racer:
        login(request, racer, backend="django.contrib.auth.backends.ModelBackend")
        request.session.set_expiry(settings.SSO_SESSION_HOURS * 3600)
    answer = redirect(assignment or (context.group.classroom if came.is_teacher else "assignments"))
    answer.delete_cookie(COOKIE, path=reverse("lti_arrival"))
    return answer


def _chosen(request: HttpRequest, came: Launch, context: LtiContext | None, do: str) -> Racer | None:
    """A person without an account here: the one that they choose. A student whom nobody is logged in as gets a new one
    unasked."""
    here = request.user if isinstance(request.user, Racer) else None
    if do == "link" and here is not None:
        return services.link_account(launch=came, racer=here, now=timezone.now()).racer
    if came.is_teacher:
        return services.make_teacher(launch=came, now=timezone.now()) if do == "new" else None
    if context is not None and (do == "new" or here is None or not services.may_link(here)):
        return services.make_student(launch=came, context=context, now=timezone.now())
    return None


def _ask(request: HttpRequest, came: Launch, **context: Any) -> HttpResponse:
    here = request.user if isinstance(request.user, Racer) else None
    mine = here if here is not None and services.may_link(here) else None
    return render(request, "courses/lti/arrival.html", {"launch": came, "mine": mine, **context})


def _led_by(racer: Racer) -> Any:
    return classes_taught_by(racer).filter(group__leader=racer)


def _count(request: HttpRequest) -> None:
    """Raises UserFault("lti_too_many")."""
    if count("courses:lti", address_of(request), RATE) is None:
        raise UserFault("lti_too_many")


def _key(key: str) -> str:
    return f"lti-arrival-{key[:100]}"


@require_GET
def key_set(request: HttpRequest) -> HttpResponse:
    """The public key, for platforms."""
    from .keys import key_set

    return JsonResponse(key_set())


@require_GET
def tool(request: HttpRequest) -> HttpResponse:
    """The tool's configuration, in the form that Canvas imports."""
    return JsonResponse(tool_configuration(request))


@login_required
@require_GET
def setup(request: HttpRequest) -> HttpResponse:
    """What an admin of a platform enters there, and the platforms that are registered here."""
    if not racer_of(request).has_perm("courses.view_ltiplatform"):
        raise PermissionDenied
    context = {"addresses": tool_addresses(request), "platforms": LtiPlatform.objects.all()}
    return render(request, "courses/lti/setup.html", context)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def courses_of_class(request: HttpRequest, slug: str) -> HttpResponse:
    """The courses of platforms that a class is linked with, and what became of its marks; for its teachers."""
    shown = get_object_or_404(classes_taught_by(request.user), group__slug=slug)
    lines = lines_of(shown)
    if request.method == "POST":
        line = get_object_or_404(lines, pk=number_sent(request, "line"))
        scores.resend(line=line, by=racer_of(request), now=timezone.now())
        messages.success(request, _("The marks are sent again."))
        return redirect("class_lti", slug)
    contexts = LtiContext.objects.filter(group=shown.group).select_related("platform")
    context = {"classroom": shown, "contexts": contexts, "lines": lines}
    return render(request, "courses/lti/class.html", context)


def lines_of(classroom: Classroom) -> QuerySet[LtiLine]:
    """The columns in grade books for the class's assignments, with numbers of ``sent``, ``due`` and ``failed`` scores
    and ``failures``, the failed ones with their reasons."""
    lines = LtiLine.objects.filter(context__group=classroom.group_id).select_related(
        "assignment", "context__platform", "context__group__classroom"
    )
    failed = LtiScore.objects.filter(state=LtiScoreState.FAILED).select_related("racer__learner")
    counts = {
        "sent": Count("scores", filter=Q(scores__state=LtiScoreState.SENT)),
        "due": Count("scores", filter=Q(scores__state__in=(LtiScoreState.DUE, LtiScoreState.SENDING))),
        "failed": Count("scores", filter=Q(scores__state=LtiScoreState.FAILED)),
        "sent_at": Max("scores__ended_at", filter=Q(scores__state=LtiScoreState.SENT)),
    }
    return lines.annotate(**counts).prefetch_related(Prefetch("scores", failed, to_attr="failures")).order_by("pk")

"""No spoilers: the races whose results are hidden from a reader until they have watched them.

A racer's switch is ``Racer.hides_results_since``, with what they watched in :class:`races.models.WatchedRace`; a guest
has both in a signed cookie. ``?spoilers=hide`` (or the header ``X-Paddock-Spoilers: hide``) hides for one answer what
is of the last days, for programs and feed readers, which have no switch; ``?spoilers=show`` shows one page anyway.

Only this module decides on hidden results: pages about a race, or with sums over several, are not rendered while one of
their races is hidden (:mod:`races.spoilers.hidden_addresses` has the list, :mod:`config.middleware.spoilers` reads it).
Pages that show results among other things leave them out with the tags of ``templatetags/spoilers.py``.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cached_property

from django.conf import settings
from django.core import signing
from django.db.models import Q
from django.http import HttpRequest, HttpResponse
from django.utils import timezone

from accounts.models import Racer
from paddock.errors import UserFault

from ..models import Entry, Race, WatchedRace

COOKIE = "no_spoilers"
HEADER = "X-Paddock-Spoilers"
PARAMETER = "spoilers"
LATELY = timedelta(days=7)  # what an answer hides without a switch
MOST_WATCHED = 100  # races in a guest's cookie; the oldest was watched long ago
_SALT = "races.spoilers.selectors"
_A_YEAR_S = 365 * 24 * 3600


@dataclass(frozen=True)
class Spoilers:
    """Results hidden from a reader. ``since``: of races from then on; None: nothing is hidden. ``watched``: the races
    with visible results, and whether their live event had begun by then. ``racer``: the owner of the stored rows, None
    for a cookie."""

    since: datetime | None = None
    cookie: Mapping[int, bool] = field(default_factory=dict)
    racer: Racer | None = None
    now: datetime | None = None

    @property
    def on(self) -> bool:
        """Whether anything may be hidden."""
        return self.since is not None

    @cached_property
    def watched(self) -> Mapping[int, bool]:
        if self.racer is None:
            return self.cookie
        return dict(WatchedRace.objects.filter(racer_id=self.racer.pk).values_list("race", "live"))

    @cached_property
    def hidden(self) -> frozenset[int]:
        """The races whose results are hidden, by id. No query unless the switch is on, else two. A race that has opened
        and had not closed before the switch was turned on, or whose live event has begun and had not ended by then; but
        for what was watched since, and for races that were called off or recorded elsewhere."""
        if self.since is None:
            return frozenset()
        now = self.now or timezone.now()
        ends = Q(live_event__ended_at=None) | Q(live_event__ended_at__gt=self.since)
        fresh = Q(opens_at__lte=now, closes_at__gt=self.since) | Q(live_event__begun_at__isnull=False) & ends
        fresh |= Q(draw__drawn_at__isnull=False, draw__over_at=None) | Q(draw__over_at__gt=self.since)
        races = Race.objects.filter(fresh, cancelled_at=None, imported_at=None).order_by()
        return frozenset(
            pk
            for pk, begun_at in races.values_list("pk", "live_event__begun_at")
            if pk not in self.watched or (begun_at is not None and not self.watched[pk])
        )

    def hides(self, race: Race | int | None) -> bool:
        """Whether the results of a race are hidden."""
        pk = race.pk if isinstance(race, Race) else race
        return self.on and pk in self.hidden


NOTHING = Spoilers()
HIDDEN = UserFault("results_hidden")


def spoilers_of(request: HttpRequest | None) -> Spoilers:
    """Hidden races of a request's reader; looked up once."""
    if request is None:
        return NOTHING
    found: Spoilers | None = getattr(request, "_spoilers", None)
    if found is None:
        found = _asked(request)
        request._spoilers = found  # type: ignore[attr-defined]
    return found


def spoilers_of_racer(racer: Racer) -> Spoilers:
    """Hidden races of a racer in any medium, for mails and notices."""
    return Spoilers(racer.hides_results_since, racer=racer)


def asks_to_hide(request: HttpRequest) -> bool:
    """Whether this answer hides results of the last days."""
    return "hide" in (request.GET.get(PARAMETER), request.headers.get(HEADER))


def _asked(request: HttpRequest) -> Spoilers:
    if request.GET.get(PARAMETER) == "show":
        return NOTHING
    mine = switch_of(request)
    if mine.on or not asks_to_hide(request):
        return mine
    return Spoilers(timezone.now() - LATELY, mine.cookie, mine.racer)


def switch_of(request: HttpRequest) -> Spoilers:
    """Hidden races by the reader's own switch, without the request's parameter."""
    user = getattr(request, "user", None)
    if user is not None and user.is_authenticated:
        return spoilers_of_racer(user)
    if COOKIE not in request.COOKIES:
        return NOTHING
    return _read(request.COOKIES[COOKIE])


def _read(text: str) -> Spoilers:
    """A guest's cookie; one without this site's signature hides nothing."""
    try:
        since, watched = json.loads(signing.Signer(salt=_SALT).unsign(text))
        return Spoilers(datetime.fromtimestamp(since, UTC), {int(pk): bool(live) for pk, live in watched})
    except (signing.BadSignature, ValueError, TypeError, OverflowError, OSError):
        return NOTHING


def write_switch(response: HttpResponse, since: datetime | None, watched: Iterable[tuple[int, bool]] = ()) -> None:
    """Keep a guest's switch and watched races in a cookie. ``since`` None: forget both."""
    if since is None:
        response.delete_cookie(COOKIE, samesite="Lax")
        return
    kept = list(watched)[-MOST_WATCHED:]
    text = json.dumps([round(since.timestamp()), [[pk, int(live)] for pk, live in kept]], separators=(",", ":"))
    signed = signing.Signer(salt=_SALT).sign(text)
    secure = settings.SESSION_COOKIE_SECURE
    response.set_cookie(COOKIE, signed, max_age=_A_YEAR_S, samesite="Lax", httponly=True, secure=secure)


def race_page_part(request: HttpRequest, race: Race, entry: Entry | None) -> dict[str, object]:
    """Whether the race's pages hide its results."""
    return {"hides": spoilers_of(request).hides(race)}

"""No spoilers: of which races the results are hidden from who asks, until they have watched them.

A racer's switch is ``Racer.hides_results_since``, with what they watched in :class:`races.models.WatchedRace`; a guest
has both in a signed cookie. ``?spoilers=hide`` (or the header ``X-Paddock-Spoilers: hide``) hides for one answer what
is of the last days, for programs and feed readers, which have no switch; ``?spoilers=show`` shows one page anyway.

What is hidden is decided here alone: pages that are about a race, or that add up several, are not made at all while
something of them is hidden (:mod:`races.spoiler_pages` has the list, :mod:`config.spoilers` asks it). Pages that show
results among other things leave them out with the tags of ``templatetags/spoilers.py``.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import TYPE_CHECKING

from django.conf import settings
from django.core import signing
from django.db.models import Q
from django.http import HttpRequest, HttpResponse
from django.utils import timezone

from paddock.errors import UserFault

from .models import Race, WatchedRace

if TYPE_CHECKING:
    from accounts.models import Racer

COOKIE = "no_spoilers"
HEADER = "X-Paddock-Spoilers"
PARAMETER = "spoilers"
LATELY = timedelta(days=7)  # what an answer hides for who has no switch
MOST_WATCHED = 100  # races in a guest's cookie; who watched more has seen the oldest long ago
_SALT = "races.spoilers"
_A_YEAR_S = 365 * 24 * 3600


@dataclass(frozen=True)
class Spoilers:
    """What is hidden from somebody. ``since``: of races from then on; None: nothing is hidden. ``watched``: the races
    whose results may be shown, and whether their live event had begun by then. ``racer``: whose rows say so, else a
    cookie does."""

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
        """The races whose results are hidden, by id. No query unless the switch is on, else two.

        A race that has opened and had not closed before the switch was turned on, or whose live event has begun and had
        not ended by then; but for what was watched since, and for races that were called off or recorded elsewhere.
        """
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


def hidden_fault() -> UserFault:
    """Why nothing is told."""
    return UserFault("results_hidden")


def spoilers_of(request: HttpRequest | None) -> Spoilers:
    """What is hidden in the answer to a request; looked up once."""
    if request is None:
        return NOTHING
    found: Spoilers | None = getattr(request, "_spoilers", None)
    if found is None:
        found = _asked(request)
        request._spoilers = found  # type: ignore[attr-defined]
    return found


def spoilers_of_racer(racer: Racer) -> Spoilers:
    """What is hidden from a racer wherever they read it: for mails and notices."""
    return Spoilers(racer.hides_results_since, racer=racer)


def asks_to_hide(request: HttpRequest) -> bool:
    """Whether this very answer is to hide what is of the last days."""
    return "hide" in (request.GET.get(PARAMETER), request.headers.get(HEADER))


def _asked(request: HttpRequest) -> Spoilers:
    if request.GET.get(PARAMETER) == "show":
        return NOTHING
    mine = switch_of(request)
    if mine.on or not asks_to_hide(request):
        return mine
    return Spoilers(timezone.now() - LATELY, mine.cookie, mine.racer)


def switch_of(request: HttpRequest) -> Spoilers:
    """What the reader's own switch hides, whatever this request asks for."""
    user = getattr(request, "user", None)
    if user is not None and user.is_authenticated:
        return spoilers_of_racer(user)
    if COOKIE not in request.COOKIES:
        return NOTHING
    return _read(request.COOKIES[COOKIE])


def _read(text: str) -> Spoilers:
    """A guest's cookie; nothing is hidden by one that this site did not write."""
    try:
        since, watched = json.loads(signing.Signer(salt=_SALT).unsign(text))
        return Spoilers(datetime.fromtimestamp(since, UTC), {int(pk): bool(live) for pk, live in watched})
    except (signing.BadSignature, ValueError, TypeError, OverflowError, OSError):
        return NOTHING


def write_switch(response: HttpResponse, since: datetime | None, watched: Iterable[tuple[int, bool]] = ()) -> None:
    """Keep a guest's switch, and what they watched, in their browser. ``since`` None: forget both."""
    if since is None:
        response.delete_cookie(COOKIE, samesite="Lax")
        return
    kept = list(watched)[-MOST_WATCHED:]
    text = json.dumps([round(since.timestamp()), [[pk, int(live)] for pk, live in kept]], separators=(",", ":"))
    signed = signing.Signer(salt=_SALT).sign(text)
    secure = settings.SESSION_COOKIE_SECURE
    response.set_cookie(COOKIE, signed, max_age=_A_YEAR_S, samesite="Lax", httponly=True, secure=secure)

"""Spectators' links: watching the live event of a race by invitation without joining it.

A link's token moves into a cookie (or the header :data:`HEADER`), so that no address shows it. It is valid for one
:attr:`races.models.Race.spectator_edition`. No row is written."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.core import signing
from django.http import HttpRequest, HttpResponse
from django.utils.crypto import constant_time_compare

from accounts.models import Racer

from ..models import Race, Visibility

COOKIE = "spectator"
HEADER = "X-Paddock-Spectator"
MOST_RACES = 8  # in one browser; the link opened longest ago makes way
LASTS_S = 30 * 24 * 3600
_SALT = "races.web.spectator_links"
_TOKEN = re.compile(r"([0-9]{1,15})-([\w-]{20,60})", re.ASCII)


def spectator_token(race: Race) -> str:
    """The token of the race's present spectators' link."""
    signature = signing.Signer(salt=_SALT, sep=":").signature(f"{race.pk}.{race.spectator_edition}")
    return f"{race.pk}-{signature}"


def race_of_token(token: str) -> Race | None:
    """The race that a token opens; None for an invalid or renewed token, and for public races."""
    found = _TOKEN.fullmatch(token)
    if found is None:
        return None
    race = Race.objects.select_related("track", "organiser").filter(pk=int(found[1])).first()
    return race if race is not None and may_watch((token,), race) else None


def may_watch(tokens: Iterable[str], race: Race) -> bool:
    """Whether one of the tokens opens the live event of this race by invitation."""
    if race.visibility != Visibility.INVITATION:
        return False
    right = spectator_token(race).encode()
    return any(constant_time_compare(token.encode("utf-8", "replace"), right) for token in tokens)


def any_is_valid(tokens: Iterable[str]) -> bool:
    """Whether at least one of the tokens opens something."""
    return any(race_of_token(token) is not None for token in tokens)


def tokens_in(cookie: str) -> tuple[str, ...]:
    """The tokens of a spectator's cookie. They are not checked."""
    found = [token for token in cookie.split(".") if _TOKEN.fullmatch(token)]
    return tuple(found[-MOST_RACES:])


def tokens_of(request: HttpRequest) -> tuple[str, ...]:
    """The tokens in a request's cookie or header."""
    sent = request.headers.get(HEADER, "")
    return (*tokens_in(request.COOKIES.get(COOKIE, "")), *tokens_in(sent))


def tokens_of_viewer(viewer: Racer | AnonymousUser | Any) -> Sequence[str]:
    """The tokens of a reader of the stream (:mod:`config.serving.streams.viewers`)."""
    return getattr(viewer, "spectator_tokens", ())


def is_spectator(request: HttpRequest) -> bool:
    """Whether a request has a spectator's token, valid or not, so that its response is private."""
    return COOKIE in request.COOKIES or HEADER in request.headers


def keep_token(request: HttpRequest, response: HttpResponse, token: str) -> None:
    """Store a token in the reader's browser, instead of an older one of the same race."""
    race = token.partition("-")[0]
    kept = [one for one in tokens_in(request.COOKIES.get(COOKIE, "")) if one.partition("-")[0] != race]
    response.set_cookie(
        COOKIE,
        ".".join([*kept, token][-MOST_RACES:]),
        max_age=LASTS_S,
        samesite="Lax",
        httponly=True,
        secure=settings.SESSION_COOKIE_SECURE,
    )

"""Identifies and rechecks stream readers by session, spectators' tokens and API token. Every call queries the database.

A browser is named by its session, and with spectators' tokens (:mod:`races.web.spectator_links`) by
``SESSION|TOKEN.TOKEN`` (:func:`name_of`), a program by the hash of its API token (:func:`token_name_of`).
"""

import copy
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

from django.conf import settings
from django.contrib.auth import BACKEND_SESSION_KEY, HASH_SESSION_KEY, SESSION_KEY
from django.contrib.auth.models import AnonymousUser
from django.db.models import Q
from django.utils import timezone
from django.utils.crypto import constant_time_compare
from knox.crypto import hash_token
from knox.models import get_token_model

from accounts.models import Racer, Viewer
from accounts.scopes import READ
from accounts.signing_in.second_factor import lacks_demanded_factor
from accounts.tokens.services import scopes_of
from core.streams import can_follow
from races.web.spectator_links import any_is_valid, tokens_in

_PROGRAM = "token:"  # no session's key has a colon
Sessions = import_module(settings.SESSION_ENGINE).SessionStore


def name_of(session: str, tokens: Iterable[str]) -> str:
    """The name of a browser with this session (empty: none) and these spectators' tokens."""
    written = ".".join(tokens)
    return f"{session}|{written}" if written else session


def token_name_of(header: str) -> str:
    """The viewer key of an Authorization header; without a valid token it matches no viewer."""
    word, _, token = header.strip().partition(" ")
    is_token = word.lower() in ("bearer", "token") and token.strip()
    return f"{_PROGRAM}{hash_token(token.strip()) if is_token else ''}"


def followed(topics: Iterable[str], viewer: Viewer) -> frozenset[str]:
    return frozenset(topic for topic in topics if can_follow(viewer, topic))


def viewers_of(browsers: Iterable[str]) -> dict[str, Viewer]:
    """The readers of valid browsers by name: racers of sessions, and guests with a valid spectators' token.
    ``spectator_tokens`` of a reader are their tokens."""
    named = {browser: browser.partition("|")[::2] for browser in browsers}
    sessions = {session for session, _ in named.values() if session}
    programs = {name for name in sessions if name.startswith(_PROGRAM)}
    racers = _racers_of(sessions - programs) if sessions - programs else {}
    racers |= _racers_of_tokens(programs) if programs else {}
    found: dict[str, Viewer] = {}
    for browser, (session, written) in named.items():
        tokens = tokens_in(written)
        viewer: Viewer = racers.get(session) if session else AnonymousUser() if any_is_valid(tokens) else None
        if viewer is not None:
            found[browser] = viewer = copy.copy(viewer) if tokens else viewer
            if tokens:
                viewer.spectator_tokens = tokens  # type: ignore[union-attr]  # spectator_links reads it
    return found


def _racers_of(sessions: Iterable[str]) -> dict[str, Racer]:
    """The racers of valid sessions, by session, by the rules of Django's log-in, in two queries; without admins who
    lack the second factor that the site demands."""
    model = Sessions.get_model_class()
    rows = model.objects.filter(session_key__in=set(sessions), expire_date__gt=timezone.now())
    sessions_data = {row.session_key: row.get_decoded() for row in rows}
    racers = _racers(sessions_data.values())
    return {
        session: racers[data[SESSION_KEY]]
        for session, data in sessions_data.items()
        if data.get(SESSION_KEY) in racers and _is_good(racers[data[SESSION_KEY]], data)
    }


def _racers_of_tokens(programs: Iterable[str]) -> dict[str, Racer]:
    """The racers of tokens that are good now and may read, by the programs' names."""
    digests = [name.removeprefix(_PROGRAM) for name in programs]
    tokens = get_token_model().objects.filter(
        Q(expiry=None) | Q(expiry__gt=timezone.now()), digest__in=digests, user__is_active=True
    )
    return {
        f"{_PROGRAM}{token.digest}": token.user
        for token in tokens.select_related("user", "grant")
        if READ in scopes_of(token) and not lacks_demanded_factor(token.user)
    }


def allowed(topics: Iterable[str], sessions: Mapping[str, set[str]]) -> tuple[set[str], dict[str, set[str]], set[str]]:
    """The topics that everybody may follow, those others that each session may, and the sessions that are over.
    ``sessions``: the topics that each session follows."""
    open_to_all = {topic for topic in topics if can_follow(None, topic)}
    asking = {session: wanted - open_to_all for session, wanted in sessions.items() if wanted - open_to_all}
    viewers = viewers_of(asking) if asking else {}
    may = {
        session: {topic for topic in asking[session] if can_follow(viewer, topic)}
        for session, viewer in viewers.items()
    }
    return open_to_all, may, set(asking) - set(viewers)


def _racers(sessions: Iterable[Mapping[str, Any]]) -> dict[str, Racer]:
    ids = {data[SESSION_KEY] for data in sessions if str(data.get(SESSION_KEY, "")).isdecimal()}
    racers = Racer.objects.filter(pk__in=ids, is_active=True)
    return {str(racer.pk): racer for racer in racers if not lacks_demanded_factor(racer)}


def _is_good(racer: Racer, data: Mapping[str, Any]) -> bool:
    if data.get(BACKEND_SESSION_KEY) not in settings.AUTHENTICATION_BACKENDS:
        return False
    known = data.get(HASH_SESSION_KEY, "")
    hashes = (racer.get_session_auth_hash(), *racer.get_session_auth_fallback_hash())
    return any(constant_time_compare(known, each) for each in hashes)

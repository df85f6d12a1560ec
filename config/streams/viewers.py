"""Who a reader is, by the session and the spectators' tokens of their browser, and whether they still are. All of it
asks the database.

A browser is named by its session, and with spectators' tokens (:mod:`races.spectators`) by ``SESSION|TOKEN.TOKEN``,
where the session may be empty: :func:`name_of`.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

from django.conf import settings
from django.contrib.auth import BACKEND_SESSION_KEY, HASH_SESSION_KEY, SESSION_KEY, get_user_model
from django.contrib.auth.models import AnonymousUser
from django.utils import timezone
from django.utils.crypto import constant_time_compare

from accounts.second_factor import lacks_demanded_factor
from core.streams import can_follow
from races.spectators import any_is_valid, tokens_in

Sessions = import_module(settings.SESSION_ENGINE).SessionStore


def name_of(session: str, tokens: Iterable[str]) -> str:
    """The name of a browser with this session (empty: none) and these spectators' tokens."""
    written = ".".join(tokens)
    return f"{session}|{written}" if written else session


def viewers_of(browsers: Iterable[str]) -> dict[str, Any]:
    """The readers of browsers that are good now, by their names: the racers of good sessions, and guests with a
    spectators' token that is valid. ``spectator_tokens`` of a reader are their tokens."""
    named = {browser: browser.partition("|")[::2] for browser in browsers}
    sessions = {session for session, _ in named.values() if session}
    racers = _racers_of(sessions) if sessions else {}
    found: dict[str, Any] = {}
    for browser, (session, written) in named.items():
        tokens = tokens_in(written)
        viewer: Any = racers.get(session) if session else AnonymousUser() if any_is_valid(tokens) else None
        if viewer is not None:
            found[browser] = viewer = copy.copy(viewer) if tokens else viewer
            if tokens:
                viewer.spectator_tokens = tokens
    return found


def _racers_of(sessions: Iterable[str]) -> dict[str, Any]:
    """The racers of sessions that are good now, by session: as Django's log-in says, in two queries. One that is over,
    was logged out, or whose racer was locked out or has changed the password is not among them; nor is an admin's
    without the second factor that the site demands."""
    model = Sessions.get_model_class()
    rows = model.objects.filter(session_key__in=set(sessions), expire_date__gt=timezone.now())
    told = {row.session_key: row.get_decoded() for row in rows}
    racers = _racers(told.values())
    return {
        session: racers[data[SESSION_KEY]]
        for session, data in told.items()
        if data.get(SESSION_KEY) in racers and _is_good(racers[data[SESSION_KEY]], data)
    }


def allowed(topics: Iterable[str], sessions: Mapping[str, set[str]]) -> tuple[set[str], dict[str, set[str]], set[str]]:
    """Who may be told of ``topics`` now. ``sessions``: the topics of these that the reader of each session follows.

    Answers with the topics that everybody may follow, those others that each session may, and the sessions that are
    over.
    """
    open_to_all = {topic for topic in topics if can_follow(None, topic)}
    asking = {session: wanted - open_to_all for session, wanted in sessions.items() if wanted - open_to_all}
    viewers = viewers_of(asking) if asking else {}
    may = {
        session: {topic for topic in asking[session] if can_follow(viewer, topic)}
        for session, viewer in viewers.items()
    }
    return open_to_all, may, set(asking) - set(viewers)


def _racers(sessions: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    ids = {data[SESSION_KEY] for data in sessions if str(data.get(SESSION_KEY, "")).isdecimal()}
    racers = get_user_model()._default_manager.filter(pk__in=ids, is_active=True)
    return {str(racer.pk): racer for racer in racers if not lacks_demanded_factor(racer)}


def _is_good(racer: Any, data: Mapping[str, Any]) -> bool:
    if data.get(BACKEND_SESSION_KEY) not in settings.AUTHENTICATION_BACKENDS:
        return False
    known = data.get(HASH_SESSION_KEY, "")
    hashes = (racer.get_session_auth_hash(), *racer.get_session_auth_fallback_hash())
    return any(constant_time_compare(known, each) for each in hashes)

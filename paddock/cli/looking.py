"""Commands that look: ``races``, ``tracks``, ``board``; and ``login``, ``logout``."""

from __future__ import annotations

import argparse
import getpass
import sys
from typing import Any

from paddock.errors import UserFault
from paddock.geometry.catalogue.names import holding, nearest

from .asking import Call, race_of
from .settings import address
from .showing import lap_time, table
from .site import Site


def login(asked: Call, options: argparse.Namespace) -> int:
    """Check a token with the site and keep it."""
    settings = asked.settings
    where = options.url or asked.site_named() or settings.usual
    if not where:
        raise UserFault("site_missing")
    asked.asked_site = where = address(where)
    site = Site(where, _token(where, options.name))
    me = site.get("/me/")
    settings.tokens[where], settings.usual = site.token, where
    settings.write()
    asked.speaker.result(
        {"site": where, "alias": me["alias"], "kept_in": str(settings.path)},
        f"You are {me['alias']} on {where}. The token is kept in {settings.path}.",
    )
    return 0


def _token(where: str, name: str) -> str:
    """A token that is asked for; with ``name`` one that the site makes for the password."""
    if name:
        body = {"login": name, "password": _secret("Password: "), "scopes": ["read", "race"]}
        if code := _line("Code of your second factor (empty without one): "):
            body["code"] = code
        return str(Site(where).post("/auth/token/", body)["token"])
    token = _secret("Token (made in your settings on the site, with the scopes read and race): ")
    if not token or not token.isascii() or not token.isprintable():
        raise UserFault("token_missing", site=where)
    return token


def _secret(prompt: str) -> str:
    return (getpass.getpass(prompt) if sys.stdin.isatty() else sys.stdin.readline()).strip()


def _line(prompt: str) -> str:
    return (input(prompt) if sys.stdin.isatty() else sys.stdin.readline()).strip()


def logout(asked: Call, options: argparse.Namespace) -> int:
    """Forget the token, and give it back to the site where that is asked for."""
    settings = asked.settings
    where = address(options.url or asked.site_named() or settings.usual or _no_site())
    token = settings.tokens.pop(where, "")
    if not token:
        raise UserFault("token_missing", site=where)
    if options.revoke:
        Site(where, token).raw("DELETE", "/auth/token/")
    settings.usual = "" if settings.usual == where else settings.usual
    settings.write()
    asked.speaker.result({"site": where, "revoked": options.revoke}, f"The token of {where} is forgotten.")
    return 0


def _no_site() -> str:
    raise UserFault("site_missing")


def races(asked: Call, options: argparse.Namespace) -> int:
    """The races of a site."""
    state = "" if options.state == "all" else options.state
    found = asked.site().pages("/races/", state=state, mine="true" if options.mine else "")
    rows = [
        (
            race["slug"],
            race["state"],
            race["track"]["slug"],
            race["race_type"],
            race["closes_at"][:16] + "Z",
            race["name"],
        )
        for race in found
    ]
    asked.speaker.result(
        found, table(("race", "state", "track", "type", "closes", "name"), rows) if rows else "No races."
    )
    return 0


def tracks(asked: Call, options: argparse.Namespace) -> int:
    """The tracks of a site; of this package where no site is known."""
    if asked.site_named() or asked.settings.usual:
        found = asked.site().pages("/tracks/", search=options.search, sort=options.sort)
    else:
        found = [_own_track(track) for track in holding(options.search)]
    rows = [
        (
            each["slug"],
            _metres(each["length_m"]),
            _metres(each["width_m"]),
            each["corners"],
            each["difficulty"],
            each["name"],
        )
        for each in found
    ]
    head = ("track", "length", "width", "corners", "difficulty", "name")
    none = f"No tracks. The closest names are: {', '.join(nearest(options.search))}."
    asked.speaker.result(found, table(head, rows) if rows else none)
    return 0


def _own_track(track: Any) -> dict[str, Any]:
    names = ("slug", "name", "length_m", "width_m", "direction", "corners", "difficulty", "fingerprint")
    return {name: getattr(track, name) for name in names}


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} m"


def board(asked: Call, options: argparse.Namespace) -> int:
    """A page of a race's board."""
    site, slug = race_of(asked, options.race)
    found = site.get(f"/races/{slug}/board/", page=options.page)
    rows = [
        (row["rank"] or "-", row["racer"], lap_time(row["score_ms"]), lap_time(row["best_lap_ms"]), row["resets"])
        for row in found["results"]
    ]
    text = table(("rank", "racer", found["ranking_method"], "best lap", "resets"), rows) if rows else "Nobody yet."
    if found["pages"] > 1:
        text += f"\npage {found['page']} of {found['pages']}; {found['classified_count']} classified"
    asked.speaker.result(found, text)
    return 0

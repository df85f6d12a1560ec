"""The commands ``races``, ``tracks``, ``board``, ``login`` and ``logout``."""

import argparse
import getpass
import sys
from collections.abc import Callable

from paddock.errors import UserFault
from paddock.geometry.catalogue.names import holding, nearest

from .asking import Call, listed, race_of
from .showing import lap_time, table
from .site import Site


def login(asked: Call, options: argparse.Namespace) -> int:
    settings, where = asked.settings, asked.address(options.url)
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
    """The token that the user enters, or with ``name`` a new one that the site issues for the password."""
    if name:
        body = {"login": name, "password": _entered("Password: ", getpass.getpass), "scopes": ["read", "race", "train"]}
        if code := _entered("Code of your second factor (empty without one): ", input):
            body["code"] = code
        return str(Site(where).post("/auth/token/", body)["token"])
    prompt = "Token (made in your settings on the site, with the scopes read, race and train): "
    token = _entered(prompt, getpass.getpass)
    if not token or not token.isascii() or not token.isprintable():
        raise UserFault("token_missing", site=where)
    return token


def _entered(prompt: str, ask: Callable[[str], str]) -> str:
    return (ask(prompt) if sys.stdin.isatty() else sys.stdin.readline()).strip()


def logout(asked: Call, options: argparse.Namespace) -> int:
    """Forget the token of a site, and with ``--revoke`` revoke it there."""
    settings, where = asked.settings, asked.address(options.url)
    token = settings.tokens.pop(where, "")
    if not token:
        raise UserFault("token_missing", site=where)
    if options.revoke:
        Site(where, token).raw("DELETE", "/auth/token/")
    settings.usual = "" if settings.usual == where else settings.usual
    settings.write()
    asked.speaker.result({"site": where, "revoked": options.revoke}, f"The token of {where} is forgotten.")
    return 0


def races(asked: Call, options: argparse.Namespace) -> int:
    state = "" if options.state == "all" else options.state
    found = asked.site().pages("/races/", state=state, mine="true" if options.mine else "")
    columns = ("race:slug", "state", "track:track.slug", "type:race_type", "closes:closes_at", "name")
    return listed(asked, found, "No races.", *columns)


def tracks(asked: Call, options: argparse.Namespace) -> int:
    """The tracks of a site; of this package where no site is known."""
    if asked.site_named():
        found = asked.site().pages("/tracks/", search=options.search, sort=options.sort)
    else:
        names = ("slug", "name", "length_m", "width_m", "direction", "corners", "difficulty", "fingerprint")
        found = [{name: getattr(track, name) for name in names} for track in holding(options.search)]
    none = f"No tracks. The closest names are: {', '.join(nearest(options.search))}."
    return listed(asked, found, none, "track:slug", "length:length_m", "width:width_m", "corners", "difficulty", "name")


def board(asked: Call, options: argparse.Namespace) -> int:
    site, slug = race_of(asked, options.race)
    found = site.get(f"/races/{slug}/board/", page=options.page)
    rows = [
        (row["rank"] or "-", row["racer"], lap_time(row["score_ms"]), lap_time(row["best_lap_ms"]), row["resets"])
        for row in found["results"]
    ]
    text = table(("rank", "racer", found["ranking_method"], "best lap", "resets"), rows, "Nobody yet.")
    if found["pages"] > 1:
        text += f"\npage {found['page']} of {found['pages']}; {found['classified_count']} classified"
    asked.speaker.result(found, text)
    return 0

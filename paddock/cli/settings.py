"""Stores the site and the token between two calls of the command."""

# The settings are a JSON file in the user's own configuration folder, with mode 0600. A token is sent only to the site
# for which it was issued. ``PADDOCK_SITE`` and ``PADDOCK_TOKEN`` belong together and take precedence over the file.

import json
import os
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

from paddock.errors import UserFault

from .files import UNREADABLE, UNWRITABLE, file_faults

SITE, TOKEN, FOLDER = "PADDOCK_SITE", "PADDOCK_TOKEN", "PADDOCK_CONFIG"


@dataclass
class Settings:
    """``usual``: the address of the last login's site; ``tokens``: by address."""

    path: Path
    usual: str = ""
    tokens: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, environment: Mapping[str, str] = os.environ) -> "Settings":
        """The stored settings; empty without a file. Raises UserFault("home_file_unreadable")."""
        path = folder(environment) / "sites.json"
        try:
            with file_faults(UNREADABLE, path):
                kept = json.loads(path.read_text(encoding="utf-8") if path.exists() else '{"usual": "", "tokens": {}}')
            return cls(path, str(kept["usual"]), {str(site): str(token) for site, token in kept["tokens"].items()})
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise UserFault("home_file_unreadable", path=str(path), problem="it is not of this command") from error

    def write(self) -> None:
        """Replace the stored settings as a whole. Raises UserFault("home_file_unwritable")."""
        with file_faults(UNWRITABLE, self.path):
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            # mkstemp: mode 0600
            number, name = tempfile.mkstemp(dir=self.path.parent, prefix=".sites-")
            with os.fdopen(number, "w", encoding="utf-8") as file:
                json.dump({"usual": self.usual, "tokens": self.tokens}, file, indent=2)
            os.replace(name, self.path)

    def token_for(self, site: str, environment: Mapping[str, str] = os.environ) -> str:
        """The token of a site, or nothing. The environment's token is for the environment's site."""
        if environment.get(TOKEN) and environment.get(SITE) and address(environment[SITE]) == site:
            return environment[TOKEN]
        return self.tokens.get(site, "")


def folder(environment: Mapping[str, str]) -> Path:
    """The folder of the user's settings on this system."""
    if named := environment.get(FOLDER):
        return Path(named)
    if sys.platform == "win32" and (roaming := environment.get("APPDATA")):
        return Path(roaming) / "paddock"
    return Path(environment.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "paddock"


def address(text: str) -> str:
    """The site's address in one form: ``https://host[:port][/prefix]``. Raises UserFault("site_address")."""
    try:
        parts = urlsplit(text.strip())
        if parts.scheme not in ("http", "https") or not parts.hostname or parts.username is not None:
            raise ValueError("not a site")
        port = f":{parts.port}" if parts.port else ""
    except ValueError as error:
        raise UserFault("site_address", address=text) from error
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    path = parts.path.rstrip("/").removesuffix("/v1").removesuffix("/api")
    return f"{parts.scheme}://{host}{port}{path}"


def split_page(given: str, kind: str) -> tuple[str, str]:
    """The site and the name in the address of a page or of the API; the site is empty for a bare name, the name for
    another page. ``kind``: the word before the name, such as ``"races"``. Raises UserFault("site_address")."""
    if "://" not in given:
        return "", given.strip("/") if "/" not in given.strip("/") else ""
    head, found, tail = given.partition(f"/{kind}/")
    return address(head), tail.split("/")[0].split("?")[0].split("#")[0] if found else ""

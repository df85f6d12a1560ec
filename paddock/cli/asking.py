"""What every command is given: where to say things, which site, which race."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from paddock.errors import UserFault

from .settings import SITE, Settings, address, split_page
from .showing import Speaker
from .site import Site

_NETWORKS = (".onnx", ".pb")


@dataclass
class Call:
    """A call of the command. ``given_site``: its option ``--site``, or nothing. ``asked_site``: the site that was asked
    last."""

    speaker: Speaker
    given_site: str = ""
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ)
    asked_site: str = ""
    _settings: Settings | None = None

    @property
    def settings(self) -> Settings:
        """What is kept, read once. Raises UserFault("home_file_unreadable")."""
        if self._settings is None:
            self._settings = Settings.read(self.environment)
        return self._settings

    def site_named(self) -> str:
        """The site that this call names by its option or the environment, or nothing."""
        return self.given_site or self.environment.get(SITE, "")

    def site(self, of_page: str = "") -> Site:
        """The site of a page's address, else the one that is named, else the usual one, with its token.

        Raises UserFault("site_missing"), ("site_address")."""
        where = of_page or self.site_named() or self.settings.usual
        if not where:
            raise UserFault("site_missing")
        self.asked_site = where = address(where)
        return Site(where, self.settings.token_for(where, self.environment))


def race_of(asked: Call, given: str) -> tuple[Site, str]:
    """The site and the slug of a race that is named by its page's address or by its slug. Raises UserFault."""
    where, slug = split_page(given, "races")
    if not slug:
        raise UserFault("race_wanted", given=given)
    return asked.site(where), slug


def result_of(asked: Call, given: str) -> tuple[Site, str]:
    """The site and the id of an evaluation, likewise. Raises UserFault."""
    where, name = split_page(given, "evaluations")
    if not name:
        raise UserFault("result_wanted", given=given)
    return asked.site(where), name


def parts_of(files: list[Path]) -> dict[str, Path]:
    """Which of the files of a model is which, as the API's upload names them.

    Raises UserFault("home_command_line") for more than two beside a ``.data`` file."""
    weights = [path for path in files if path.name.endswith(".data")]
    loose = [path for path in files if path not in weights]
    if not loose or len(loose) > 2 or len(weights) > 1:
        raise UserFault("home_command_line", problem="a model is one archive, or a network and its model_metadata.json")
    kind = "model" if loose[0].suffix in _NETWORKS and len(loose) == 2 else "package"
    parts = {kind: loose[0]}
    if len(loose) == 2:
        parts["metadata"] = loose[1]
    if weights:
        parts["weights"] = weights[0]
    return parts

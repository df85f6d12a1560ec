"""Which races take further submitted cars. Plain values: the site, the pipeline and the command line ask here."""

from __future__ import annotations

from paddock.errors import UserFault
from paddock.rules.race import HEAD_TO_HEAD, MAX_CARS, RaceRules


def check_rivals(rules: RaceRules, rivals: int) -> None:
    """Raise UserFault (``rivals_race_type``, ``rivals_with_bots``, ``too_many_rivals``) unless so many may join."""
    if not rivals:
        return
    if rules.race_type != HEAD_TO_HEAD:
        raise UserFault("rivals_race_type")
    if rules.bots:
        raise UserFault("rivals_with_bots")
    if rivals >= MAX_CARS:
        raise UserFault("too_many_rivals", limit=MAX_CARS - 1)

"""What a car looks like in pages: a shell and a colour. Neither is seen by any sensor nor moves any lap time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from django.db import models
from django.utils.translation import gettext_lazy as _

DEFAULT_COLOUR = "#3b82f6"
COLOUR = r"^#[0-9a-f]{6}$"
# For cars whose own colour is too near another's in the same run; told apart by people who see few colours as well.
_SPARE = ("#3b82f6", "#f59e0b", "#ec4899", "#14b8a6", "#f8fafc", "#ef4444", "#84cc16")
_APART = 120.0  # of about 765 from black to white


class Shell(models.TextChoices):
    """The shells that a car may wear."""

    PADDOCK = "paddock", _("Paddock")
    FORMULA = "formula", _("Formula")
    COUPE = "coupe", _("Coupé")
    HATCH = "hatch", _("Hatchback")
    BUGGY = "buggy", _("Buggy")
    KART = "kart", _("Kart")
    PICKUP = "pickup", _("Pick-up")
    VAN = "van", _("Van")
    WAGON = "wagon", _("Estate")
    ROVER = "rover", _("Rover")
    ROADSTER = "roadster", _("Roadster")
    WEDGE = "wedge", _("Wedge")


class VehicleLook(NamedTuple):
    """A shell, one of :class:`Shell`, and a colour as ``#rrggbb``."""

    shell: str = Shell.PADDOCK.value
    colour: str = DEFAULT_COLOUR


def told_apart(looks: Sequence[VehicleLook]) -> list[VehicleLook]:
    """The looks of cars that drive together. Each keeps its shell, and its colour unless it is too near that of a car
    before it: then it wears the first spare colour that is far enough from all of them."""
    worn: list[str] = []
    for look in looks:
        wanted = (look.colour, *_SPARE)
        worn.append(
            next((one for one in wanted if all(_distance(one, other) >= _APART for other in worn)), look.colour)
        )
    return [look._replace(colour=colour) for look, colour in zip(looks, worn, strict=True)]


def _distance(one: str, other: str) -> float:
    """How different two colours look: a weighted distance of their red, green and blue ("redmean", Riemersma 2001)."""
    (r, g, b), (r2, g2, b2) = (tuple(bytes.fromhex(colour[1:])) for colour in (one, other))
    mean = (r + r2) / 2
    return ((2 + mean / 256) * (r - r2) ** 2 + 4 * (g - g2) ** 2 + (2 + (255 - mean) / 256) * (b - b2) ** 2) ** 0.5

"""Shells and colours of vehicles. No sensor sees them and no lap time depends on them."""

from collections.abc import Sequence
from typing import NamedTuple

from django.db import models
from django.utils.translation import gettext_lazy as _

DEFAULT_COLOUR = "#3b82f6"
COLOUR = r"^#[0-9a-f]{6}$"
# For cars with a colour too close to another's in the same run; colour-blind viewers can distinguish them.
_SPARE = ("#3b82f6", "#f59e0b", "#ec4899", "#14b8a6", "#f8fafc", "#ef4444", "#84cc16", "#a855f7")
_APART = 120.0  # of about 765 from black to white


class Shell(models.TextChoices):
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


def distinguish_looks(looks: Sequence[VehicleLook]) -> list[VehicleLook]:
    """The looks of cars that drive together. A colour too close to an earlier car's becomes the first spare one that is
    far enough from all of them."""
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

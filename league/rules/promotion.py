"""Who is promoted from the open division."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from typing import TypeVar

from django.utils.translation import gettext as _

R = TypeVar("R", bound=Hashable)


@dataclass(frozen=True)
class Promotion:
    """The best ``percent`` of the classified racers of an open race: the old league's rule with 10.

    ``percent``: more than 0 and less than 100, else ValueError.
    """

    percent: Decimal

    def __post_init__(self) -> None:
        object.__setattr__(self, "percent", Decimal(str(self.percent)))
        if not 0 < self.percent < 100:
            raise ValueError(f"percent must lie between 0 and 100, not {self.percent}")

    def places(self, classified: int) -> int:
        """How many places of a race with so many classified racers promote: rounded half up, at least one if any."""
        if classified <= 0:
            return 0
        share = (classified * self.percent / 100).quantize(Decimal(1), ROUND_HALF_UP)
        return max(1, int(share))

    def promoted(self, order: Sequence[R], classified: int, already: Collection[R] = ()) -> list[tuple[int, R]]:
        """Place and racer of everybody who is promoted now.

        ``order``: the classified racers, the best first, at least as many as :meth:`places` says; ``already``: those
        who have a division, who keep it. A racer promoted earlier leaves their place to nobody.
        """
        held = set(already)
        best = enumerate(order[: self.places(classified)], start=1)
        return [(place, racer) for place, racer in best if racer not in held]

    def sentence(self) -> str:
        """The rule in the reader's language."""
        return _(
            "Everyone starts in the open division. When a month's open race closes, the best "
            "%(percent)s %% of its classified racers, rounded half up and at least one, move to the "
            "pro division for the rest of the season. Once promoted, you stay promoted. The place of "
            "an already promoted racer is not passed on."
        ) % {"percent": f"{self.percent.normalize():f}"}

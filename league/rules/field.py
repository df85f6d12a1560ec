"""Who comes into a month's finale, and from there into the championship."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar

from django.utils.translation import ngettext

R = TypeVar("R", bound=Hashable)


def first_without(order: Iterable[R], without: Collection[R], size: int) -> list[R]:
    """The first ``size`` of ``order`` that are not among ``without``."""
    held = set(without)
    return list(islice((racer for racer in order if racer not in held), size))


@dataclass(frozen=True)
class FinaleField:
    """The best ``size`` (1 or more, else ValueError) of a pro race who have not qualified for the championship yet."""

    size: int

    def __post_init__(self) -> None:
        if self.size < 1:
            raise ValueError(f"size must be at least 1, not {self.size}")

    def field(self, order: Iterable[R], qualified: Collection[R]) -> list[R]:
        """The field, the best first. ``order``: the classified racers of the pro race; ``qualified``: by then."""
        return first_without(order, qualified, self.size)

    def sentence(self) -> str:
        """The rule in the reader's language."""
        return ngettext(
            "A month's pro race is a qualifier. Its best racer without a championship place drives the finale.",
            "A month's pro race is a qualifier. Its best %(size)s racers without a championship "
            "place meet in the finale.",
            self.size,
        ) % {"size": self.size}


@dataclass(frozen=True)
class ChampionshipField:
    """The first ``places`` (1 or more, else ValueError) of a finale qualify for the championship, each once."""

    places: int

    def __post_init__(self) -> None:
        if self.places < 1:
            raise ValueError(f"places must be at least 1, not {self.places}")

    def qualified(self, order: Iterable[R], before: Collection[R]) -> list[R]:
        """Who qualifies in a finale, the winner first. ``before``: who had qualified when it closed."""
        return first_without(order, before, self.places)

    def sentence(self) -> str:
        """The rule in the reader's language."""
        return ngettext(
            "The winner of a finale qualifies for the championship, which closes the season.",
            "The best %(places)s of a finale without a championship place qualify for the "
            "championship, which closes the season.",
            self.places,
        ) % {"places": self.places}

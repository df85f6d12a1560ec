"""Better or worse than before, and by how much: one result of a racer in a race held against their best earlier one."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from django.utils.translation import gettext as _

from .ranking import Standing


class Kind(StrEnum):
    """How two results of a racer compare. By time in milliseconds, by distance in percent of a lap."""

    FIRST = "first"  # nothing earlier
    FASTER = "faster"
    SLOWER = "slower"
    CLASSIFIED = "classified"  # no earlier one was
    LOST = "lost"  # an earlier one is classified, this one is not
    TIE_WON = "tie_won"  # the same score, ahead by the best lap or by fewer resets
    SAME = "same"  # not better in anything
    FARTHER = "farther"  # neither is classified
    LESS_FAR = "less_far"


BETTER = (Kind.FIRST, Kind.FASTER, Kind.CLASSIFIED, Kind.TIE_WON, Kind.FARTHER)
WORSE = (Kind.SLOWER, Kind.LOST, Kind.LESS_FAR)


class Change(NamedTuple):
    """``by``: milliseconds or percent of a lap, not negative; 0 where the kind has no amount."""

    kind: Kind
    by: int = 0

    @property
    def is_better(self) -> bool:
        """Whether the result took the place of what stood there before."""
        return self.kind in BETTER

    @property
    def is_worse(self) -> bool:
        return self.kind in WORSE

    @property
    def sentence(self) -> str:
        """The comparison in the reader's language."""
        return sentence(self.kind, self.by)


def change(standing: Standing, before: Standing | None) -> Change:
    """How a result compares with the best of the earlier ones; ``before=None``: there is none."""
    if before is None:
        return Change(Kind.FIRST)
    if standing.classified != before.classified:
        return Change(Kind.CLASSIFIED if standing.classified else Kind.LOST)
    tied = Change(Kind.TIE_WON if standing.key < before.key else Kind.SAME)
    if standing.classified:
        by = (standing.score_ms or 0) - (before.score_ms or 0)
        return tied if not by else Change(Kind.FASTER if by < 0 else Kind.SLOWER, abs(by))
    by = standing.driven_percent - before.driven_percent
    return tied if not by else Change(Kind.FARTHER if by > 0 else Kind.LESS_FAR, abs(by))


def sentence(kind: str, by: int) -> str:
    """A change in a sentence of the reader's language; of a result that is not better, that the board did not change.
    Empty for a kind that is not known."""
    said: dict[str, str] = {
        Kind.FIRST: _("Your first result in this race."),
        Kind.FASTER: _("%(by)s s faster than before."),
        Kind.SLOWER: _("%(by)s s slower than before: the board did not change."),
        Kind.CLASSIFIED: _("Classified here for the first time."),
        Kind.LOST: _("An earlier car of yours is classified: the board did not change."),
        Kind.TIE_WON: _("As fast as before, and better by the best lap or by fewer resets."),
        Kind.SAME: _("No better than before: the board did not change."),
        Kind.FARTHER: _("%(by)s %% of a lap farther than before."),
        Kind.LESS_FAR: _("%(by)s %% of a lap less far than before: the board did not change."),
    }
    timed = kind in (Kind.FASTER, Kind.SLOWER)
    return said.get(kind, "") % {"by": f"{by // 1000}.{by % 1000:03}" if timed else by}

"""Better or worse than before, and by how much: one result of a racer in a race held against their best earlier one."""

from enum import StrEnum
from typing import NamedTuple

from django.utils.translation import gettext as _

from .ranking import Standing


class ChangeKind(StrEnum):
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


BETTER = (ChangeKind.FIRST, ChangeKind.FASTER, ChangeKind.CLASSIFIED, ChangeKind.TIE_WON, ChangeKind.FARTHER)


class Change(NamedTuple):
    """``by``: milliseconds or percent of a lap, not negative; 0 where the kind has no amount."""

    kind: ChangeKind
    by: int = 0

    @property
    def is_better(self) -> bool:
        """Whether the result replaced the previous one on the board."""
        return self.kind in BETTER

    @property
    def sentence(self) -> str:
        return sentence(self.kind, self.by)


def change(standing: Standing, before: Standing | None) -> Change:
    """How a result compares with the best of the earlier ones; ``before=None``: there is none."""
    if before is None:
        return Change(ChangeKind.FIRST)
    if standing.classified != before.classified:
        return Change(ChangeKind.CLASSIFIED if standing.classified else ChangeKind.LOST)
    tied = Change(ChangeKind.TIE_WON if standing.key < before.key else ChangeKind.SAME)
    if standing.classified:
        by = (standing.score_ms or 0) - (before.score_ms or 0)
        return tied if not by else Change(ChangeKind.FASTER if by < 0 else ChangeKind.SLOWER, abs(by))
    by = standing.driven_percent - before.driven_percent
    return tied if not by else Change(ChangeKind.FARTHER if by > 0 else ChangeKind.LESS_FAR, abs(by))


def sentence(kind: str, by: int) -> str:
    """A change in the reader's language; empty for an unknown kind."""
    sentences: dict[str, str] = {
        ChangeKind.FIRST: _("Your first result in this race."),
        ChangeKind.FASTER: _("%(by)s s faster than before."),
        ChangeKind.SLOWER: _("%(by)s s slower than before: the board did not change."),
        ChangeKind.CLASSIFIED: _("Classified here for the first time."),
        ChangeKind.LOST: _("An earlier car of yours is classified: the board did not change."),
        ChangeKind.TIE_WON: _("Same time as before, better by best lap or fewer resets."),
        ChangeKind.SAME: _("No better than before: the board did not change."),
        ChangeKind.FARTHER: _("%(by)s %% of a lap farther than before."),
        ChangeKind.LESS_FAR: _("%(by)s %% of a lap short of before: the board did not change."),
    }
    timed = kind in (ChangeKind.FASTER, ChangeKind.SLOWER)
    return sentences.get(kind, "") % {"by": f"{by // 1000}.{by % 1000:03}" if timed else by}

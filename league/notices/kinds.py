"""The kinds of notices, from which settings, API, mails, webhooks, hidden results and docs are made."""

from typing import Any

from django.utils.translation import gettext_lazy as _
from django.utils.translation import gettext_noop

from races.events import RACE_OFFICIAL, RACE_OPENED

from ..events import PROMOTED as RACER_PROMOTED
from ..events import QUALIFIED as RACER_QUALIFIED


class NoticeKind(str):
    """The name of a kind, as rows and the API have it.

    ``label``: completes "notify me when". ``sentence``: the text and the mail's subject. ``mailed``: whether e-mail is
    on by default. ``spoils``: whether it may show a result that a racer hides. ``webhook``: the event with the same
    sentence.
    """

    label: Any
    sentence: str
    mailed: bool
    spoils: bool
    webhook: str


KINDS: dict[str, NoticeKind] = {}
LONGEST = 12  # letters of a name, as in the column


def register(
    name: str, label: Any, sentence: str, *, mailed: bool = True, spoils: bool = True, webhook: str = ""
) -> NoticeKind:
    """Add a kind. Raises ValueError for a name that is taken or too long."""
    if name in KINDS or not 1 <= len(name) <= LONGEST:
        raise ValueError(f"{name!r} is the name of another kind, or not of 1 to {LONGEST} letters")
    kind = NoticeKind(name)
    kind.label, kind.sentence, kind.mailed, kind.spoils, kind.webhook = label, sentence, mailed, spoils, webhook
    KINDS[name] = kind
    return kind


def choices() -> list[tuple[str, Any]]:
    return [(str(kind), kind.label) for kind in KINDS.values()]


def not_mailed() -> list[str]:
    """Kinds that go to the site only, unless the racer chooses otherwise."""
    return [str(kind) for kind in KINDS.values() if not kind.mailed]


OPENS = register("opens", _("a race opens"), gettext_noop("%(race)s is open."), spoils=False, webhook=RACE_OPENED.name)
CLOSES = register(
    "closes",
    _("a race closes in a day"),
    gettext_noop("%(race)s closes in less than a day, at %(closes)s."),
    spoils=False,
)
# Comes seconds after a submission. The sentence is that of old notices without a score.
RESULT = register(
    "result", _("a result is in"), gettext_noop("The result of your car in %(race)s is in."), mailed=False
)
LOST_LEAD = register("lost_lead", _("the lead is lost"), gettext_noop("%(leader)s has taken the lead in %(race)s."))
PROMOTED = register(
    "promoted",
    _("promoted"),
    gettext_noop("You are promoted to the pro division of %(season)s."),
    webhook=RACER_PROMOTED.name,
)
FINALE = register("finale", _("in the finale"), gettext_noop("You are in the finale of %(month)s."))
QUALIFIED = register(
    "qualified",
    _("qualified for the championship"),
    gettext_noop("You have qualified for the championship of %(season)s."),
    webhook=RACER_QUALIFIED.name,
)
OFFICIAL = register(
    "official",
    _("results are official"),
    gettext_noop("The results of %(race)s are official."),
    webhook=RACE_OFFICIAL.name,
)
MESSAGE = register(
    "message", _("an announcement from the organisers"), gettext_noop("%(race)s: %(text)s"), spoils=False
)
CANCELLED = register(
    "cancelled", _("a race is cancelled"), gettext_noop("%(race)s is cancelled: %(text)s"), spoils=False
)
DISQUALIFIED = register(
    "disqualified",
    _("disqualified by the stewards"),
    gettext_noop("You are disqualified from %(race)s (%(text)s)."),
)
RESTORED = register(
    "restored",
    _("reinstated by the stewards"),
    gettext_noop("You are no longer disqualified from %(race)s (%(text)s)."),
)
RETIMED = register(
    "retimed",
    _("your time changed with a new engine"),
    gettext_noop(
        "%(race)s was repeated with the engine %(engine)s. Your result: %(new)s (before, with %(before)s: %(old)s)."
    ),
)
CUP = register(
    "cup",
    _("a cup of the day is over"),
    gettext_noop("The cup of %(day)s is over. Your place in division %(division)s: %(place)s."),
    mailed=False,
)
FOLLOWED = register(
    "followed",
    _("a racer you follow leads or wins"),
    gettext_noop("%(racer)s leads %(race)s with %(score)s."),
    mailed=False,
)
TEAM = register("team", _("a team asks you to join"), gettext_noop("The team %(team)s asks you to join."), spoils=False)
DIFFERS = register(
    "differs",
    _("a result came to something else when driven again (for admins)"),
    gettext_noop("%(run)s came to something else when it was driven again on %(worker)s: %(what)s."),
    spoils=False,
)
SEASON = register(
    "season",
    _("the next season is drafted (for admins)"),
    gettext_noop(
        "%(season)s is drafted. It continues %(before)s from %(opens)s. You can edit, replace or delete it before then."
    ),
    spoils=False,
)

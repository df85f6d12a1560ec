"""Changes of organisers to the races of a season, and their consequences."""

from collections import Counter
from collections.abc import Callable, Iterable
from datetime import datetime, timedelta

from django.db import transaction
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext

from accounts.models import Racer
from core.audit.recording import audited
from paddock.errors import UserFault
from races.boards.selectors.board import CLASSIFIED
from races.entries.services.entries import remove_entry
from races.models import Entry, Race, RaceState
from races.pages.services import edit_race

from ...models import ChampionshipPlace, FinalePlace, Membership, Round, RoundPoints, Season, Stage
from ...models.season import WITH_FIELD, WITH_POINTS
from ...notices.services import announce
from .seasons import hold_season

Fact = tuple[str, str, str]
_BOARD = "board"  # of a pro race, a finale or a championship


@audited("round.postponed", gettext_lazy("Round postponed"))
@transaction.atomic
def postpone_round(*, round: Round, hours: int, reason: str, now: datetime) -> Race:
    """Move a round's race by 1 to 2,160 hours, and notify its racers of the reason; an open race only closes later.

    Raises UserFault("postpone_hours" | "race_closed" | "race_cancelled"), RaceRefused, ValidationError for an overlap.
    """
    if not 1 <= hours <= 90 * 24:
        raise UserFault("postpone_hours", most=90 * 24)
    hold_season(round.race)  # of two postponements at once, the second adds to the first
    race, by = Race.objects.get(pk=round.race_id), timedelta(hours=hours)
    changes = {"closes_at": race.closes_at + by}
    if race.state_at(now) == RaceState.UPCOMING:
        changes["opens_at"] = race.opens_at + by
    race = edit_race(race=race, now=now, **changes)
    round.race = race
    round.full_clean()
    announce(race=race, text=reason, now=now)
    return race


class _Undone(Exception):
    """Takes a transaction back that was only tried."""


def consequences_of(call: Callable[[], object], season: Season) -> list[str]:
    """The consequences of ``call`` for a season, as sentences, found by a call in a transaction that is rolled back."""
    before = _facts(season)
    after: dict[Fact, str] = {}
    try:
        with transaction.atomic():
            call()
            after = _facts(season)
            raise _Undone
    except _Undone:
        pass
    lost, won = before.keys() - after.keys(), after.keys() - before.keys() - _boards(after)
    lines = [_("%(racer)s is no longer %(what)s (%(race)s).") % _named(fact) for fact in sorted(lost)]
    lines += [_("%(racer)s is now %(what)s (%(race)s).") % _named(fact) for fact in sorted(won)]
    moved = Counter(fact[1] for fact in before.keys() & after.keys() if before[fact] != after[fact])
    for race, count in sorted(moved.items()):
        text = ngettext(
            "%(count)s racer changes place or points (%(race)s).",
            "%(count)s racers change place or points (%(race)s).",
            count,
        )
        lines.append(text % {"count": count, "race": race})
    losers = {alias for _kind, _race, alias in lost}
    kept = sorted(fact for fact in (before.keys() & after.keys()) - _boards(after) if fact[2] in losers)
    lines += [_("%(racer)s stays %(what)s (%(race)s).") % _named(fact) for fact in kept]
    if lost:
        lines.append(_("Laps and runs stay to be looked into."))
    return lines or [_("Promotions, finale fields, championship places and points do not change.")]


def removal_consequences(round_: Round, entry: Entry, *, by: Racer, now: datetime) -> list[str]:
    """The consequences for the season if an entry left its race now, as sentences."""
    if round_.closed_at is None:
        return []
    if not round_.is_under_review(now):
        return [_("The results are final. Promotions, finale fields, championship places and points do not change.")]
    return consequences_of(lambda: remove_entry(entry=entry, by=by, now=now), round_.season)


def cancelling_consequences(round_: Round) -> list[str]:
    """The consequences for the season if the race of a round were cancelled, as sentences."""
    lines = {
        Stage.OPEN: [_("No racer is promoted from this open race.")],
        Stage.PRO: [_("No racer qualifies for this month's finale. Cancel it, too.")],
        Stage.FINALE: [_("No racer qualifies for the championship in this finale.")],
        Stage.CHAMPIONSHIP: [_("The season has no champion.")],
    }.get(Stage(round_.stage), [])
    if round_.stage in WITH_POINTS:
        lines.append(_("No points; not a round of the standings."))
    return lines


def _facts(season: Season) -> dict[Fact, str]:
    """What the season's official rounds gave: kind, race and racer, with the place or points."""
    facts: dict[Fact, str] = {}
    members = Membership.objects.filter(season=season, promoted_in__isnull=False)
    for race, alias, place in members.values_list("promoted_in__race__name", "racer__alias", "place"):
        facts["promoted", race, alias] = str(place)
    for kind, model in (("finale", FinalePlace), ("qualified", ChampionshipPlace)):
        rows = model.objects.filter(round__season=season)
        for race, alias, place in rows.values_list("round__race__name", "racer__alias", "place"):
            facts[kind, race, alias] = str(place)
    points = RoundPoints.objects.filter(round__season=season)
    for race, alias, rank, won in points.values_list("round__race__name", "racer__alias", "rank", "points"):
        facts["points", race, alias] = f"{rank}:{won}"
    boards = {"race__round__season": season, "race__round__stage__in": [Stage.PRO, *WITH_FIELD]}
    placed = Entry.objects.filter(CLASSIFIED, withdrawn_at=None, is_baseline=False, **boards)
    for race, alias in placed.values_list("race__name", "racer__alias"):
        facts[_BOARD, race, alias] = ""
    return facts


def _boards(facts: Iterable[Fact]) -> set[Fact]:
    return {fact for fact in facts if fact[0] == _BOARD}


def _named(fact: Fact) -> dict[str, str]:
    kinds = {
        "promoted": _("promoted"),
        "finale": _("in the finale"),
        "qualified": _("qualified for the championship"),
        _BOARD: _("on the board"),
        "points": _("in the points"),
    }
    return {"what": kinds[fact[0]], "race": fact[1], "racer": fact[2]}

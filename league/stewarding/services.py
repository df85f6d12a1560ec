"""Corrections of official results by stewards within the window: disqualify, reinstate, revoke."""

from datetime import datetime

from django.db import transaction
from django.db.models import QuerySet
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.events import record
from paddock.errors import UserFault
from races.entries.services.entries import remove_entry, restore_entry
from races.entries.time_checks import moment
from races.models import Entry, Race, RaceState

from ..events import DISQUALIFIED, RESTORED
from ..models import Decision, Round, Season, Stage, StewardDecision
from ..models.season import WITH_FIELD
from ..standings.services import give_fields
from .official_results import forget_outcomes, rework

_REASON_LIMIT = StewardDecision._meta.get_field("reason").max_length


@audited("steward.disqualified", _("Racer disqualified"))
@transaction.atomic
def disqualify(*, round: Round, racer: Racer, by: Racer, reason: str, now: datetime) -> StewardDecision:
    """Take a racer out of a round for a public reason, before the steward window ends; the season is recomputed.

    Raises UserFault("steward_is_no_admin" | "steward_needs_a_reason" | "not_in_the_race" | "steward_window_over").
    """
    round_, reason = _review(round, by, reason, now)
    entry = _entry(round_, racer)
    remove_entry(entry=entry, by=by, now=now, reason=reason)
    return _decide(round_, Decision.DISQUALIFIED, by, reason, now, racer)


@audited("steward.reinstated", _("Disqualification revoked"))
@transaction.atomic
def put_back(*, round: Round, racer: Racer, by: Racer, reason: str, now: datetime) -> StewardDecision:
    """Undo a disqualification; everything follows as if it had not been. Raises as :func:`disqualify`."""
    round_, reason = _review(round, by, reason, now)
    restore_entry(entry=_entry(round_, racer), by=by, now=now)
    return _decide(round_, Decision.RESTORED, by, reason, now, racer)


@audited("steward.reopened", _("Official results revoked"))
@transaction.atomic
def reopen_round(*, round: Round, by: Racer, reason: str, now: datetime) -> StewardDecision:
    """Revoke official results until an admin publishes them again, while nothing official or driven depends on them.

    Raises UserFault("round_not_official" | "reopen_later_first" | "reopen_field_drives"), or as :func:`disqualify`.
    """
    round_, reason = _review(round, by, reason, now)
    if round_.closed_at is None:
        raise UserFault("round_not_official")
    official = Round.objects.filter(season=round_.season_id, closed_at__isnull=False).select_related("race")
    later = official.filter(race__closes_at__gt=round_.race.closes_at).order_by("-race__closes_at").first()
    if later is not None:
        raise UserFault("reopen_later_first", race=later.race.name)
    for one in _fed_by(round_):
        if one.race.state_at(now) != RaceState.UPCOMING:
            raise UserFault("reopen_field_drives", race=one.race.name)
    forget_outcomes([round_])
    Round.objects.filter(pk=round_.pk).update(closed_at=None, held_at=now)
    give_fields(round_.season, now=now)
    round.refresh_from_db()
    return _decide(round_, Decision.REOPENED, by, reason, now, None)


@audited("steward.locked", _("Steward window ended"))
@transaction.atomic
def lock_round(*, round: Round, by: Racer, reason: str, now: datetime) -> StewardDecision:
    """End the steward window now. Raises UserFault("round_not_official"), or as :func:`disqualify`."""
    round_, reason = _review(round, by, reason, now)
    if round_.closed_at is None:
        raise UserFault("round_not_official")
    Round.objects.filter(pk=round_.pk).update(locked_at=now)
    round.refresh_from_db()
    return _decide(round_, Decision.LOCKED, by, reason, now, None)


def correct_results(*, round: Round, now: datetime) -> None:
    """Let the season follow what has changed on the board of an official round; nothing once the window is over."""
    if round.is_under_review(now):
        rework(round=round, now=now)


def _review(round_: Round, by: Racer, reason: str, now: datetime) -> tuple[Round, str]:
    """The round under the season's lock, and the reason on one line."""
    if not by.is_staff:
        raise UserFault("steward_is_no_admin")
    reason = " ".join(reason.split())[:_REASON_LIMIT]
    if not reason:
        raise UserFault("steward_needs_a_reason")
    season = Season.objects.select_for_update().get(pk=round_.season_id)
    fresh = Round.objects.select_related("race").get(pk=round_.pk)
    fresh.season = season
    settled = fresh.settled_at
    if settled is not None and not fresh.is_under_review(now):
        raise UserFault("steward_window_over", ended=moment(settled))
    return fresh, reason


def _entry(round_: Round, racer: Racer) -> Entry:
    entry = Entry.objects.filter(race=round_.race_id, racer=racer).select_related("race").first()
    if entry is None:
        raise UserFault("not_in_the_race", racer=racer.alias, race=round_.race.name)
    return entry


def _fed_by(round_: Round) -> QuerySet[Round]:
    """The races whose field comes of this round."""
    fields = Round.objects.filter(season=round_.season_id, stage__in=WITH_FIELD).select_related("race")
    if round_.stage == Stage.PRO:
        return fields.filter(stage=Stage.FINALE, number=round_.number)
    return fields.filter(stage=Stage.CHAMPIONSHIP) if round_.stage == Stage.FINALE else fields.none()


def _decide(
    round_: Round, decision: Decision, by: Racer, reason: str, now: datetime, racer: Racer | None
) -> StewardDecision:
    decided = StewardDecision.objects.create(round=round_, racer=racer, decision=decision, reason=reason, by=by, at=now)
    kind = {Decision.DISQUALIFIED: DISQUALIFIED, Decision.RESTORED: RESTORED}.get(decision)
    if kind is not None and racer is not None:
        record(kind, at=now, racer=racer.pk, race=round_.race_id, subject=str(decided.pk), reason=reason)
    return decided


def follow_board(sender: object, *, race: Race, now: datetime, **kwargs: object) -> None:
    """Correct an official round under review when the board of its race changes."""
    round_ = Round.objects.filter(race=race, closed_at__isnull=False).select_related("season", "race").first()
    if round_ is not None:
        correct_results(round=round_, now=now)

"""Why a training ended, as a sentence for whoever reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from .models import EndReason, TrainingJob
from .rewards.speed import SLOW_MS

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


def how_it_ended(job: TrainingJob, reader: Racer | AnonymousUser) -> str:
    """Why the training ended, in the reader's language, with the milliseconds of a slow reward function's calls; ``""``
    while it has not. The stable code is ``job.ended_because``."""
    why = _why(job, reader)
    if job.reward_ms is None or job.reward_ms < SLOW_MS or job.ended_because == EndReason.FAILED:
        return why
    slow = _("Each call of the reward function took %(ms)s ms, a fast one takes less than 1 ms.")
    return f"{why} {slow % {'ms': f'{job.reward_ms:,.0f}'}}"


def _why(job: TrainingJob, reader: Racer | AnonymousUser) -> str:
    match job.ended_because:
        case EndReason.TIME:
            return ngettext(
                "Its %(count)s minute of training was used up.",
                "Its %(count)s minutes of training were used up.",
                job.stop_minutes,
            ) % {"count": job.stop_minutes}
        case EndReason.STEPS:
            return ngettext(
                "It had driven the %(count)s step that it was to drive.",
                "It had driven the %(count)s steps that it was to drive.",
                job.stop_steps or 0,
            ) % {"count": f"{job.stop_steps or 0:,}"}
        case EndReason.CLEAN_LAPS:
            return ngettext(
                "It drove %(count)s clean lap, as it was to do.",
                "It drove %(count)s clean laps in a row, as it was to do.",
                job.stop_clean_laps or 0,
            ) % {"count": job.stop_clean_laps or 0}
        case EndReason.STOPPED:
            return _stopped(job, reader)
        case EndReason.FAILED:
            return job.reason
    return ""


def _stopped(job: TrainingJob, reader: Racer | AnonymousUser) -> str:
    begun = job.started_at is not None
    if job.stopped_by_id is not None and job.stopped_by_id != job.owner_id:
        return (
            _("An admin of this site stopped it.") if begun else _("An admin of this site stopped it before it began.")
        )
    if reader.pk == job.owner_id:
        return _("You stopped it.") if begun else _("You stopped it before it began.")
    return _("Its owner stopped it.") if begun else _("Its owner stopped it before it began.")

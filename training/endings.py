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
    return f"{why}. {slow % {'ms': f'{job.reward_ms:,.0f}'}}"


def _why(job: TrainingJob, reader: Racer | AnonymousUser) -> str:
    match job.ended_because:
        case EndReason.TIME:
            return ngettext(
                "Time limit reached (%(count)s minute)",
                "Time limit reached (%(count)s minutes)",
                job.stop_minutes,
            ) % {"count": job.stop_minutes}
        case EndReason.STEPS:
            return ngettext(
                "Step limit reached (%(count)s)",
                "Step limit reached (%(count)s)",
                job.stop_steps or 0,
            ) % {"count": f"{job.stop_steps or 0:,}"}
        case EndReason.CLEAN_LAPS:
            return ngettext(
                "Goal reached: %(count)s clean lap",
                "Goal reached: %(count)s clean laps in a row",
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
        return _("Stopped by an admin") if begun else _("Stopped by an admin before it started")
    if reader.pk == job.owner_id:
        return _("Stopped by you") if begun else _("Stopped by you before it started")
    return _("Stopped by its owner") if begun else _("Stopped by its owner before it started")

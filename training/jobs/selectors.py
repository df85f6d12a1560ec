"""Trainings that a racer sees, their ends in words, and what a racer may still train."""

from collections.abc import Sequence
from datetime import datetime

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.db.models import QuerySet
from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from accounts.models import Racer
from accounts.quotas import Usage, limit_of, used_by
from accounts.usage.selectors import usage_of
from core.events import Event
from core.forms import explain
from core.streams.topics import Viewer, is_known
from paddock.errors import PlatformFault

from ..events import TRAINING_ENDED
from ..models import EndReason, TrainingJob
from ..quotas import MINUTES, used_quotas
from ..rewards.sandbox.hints import SLOW_MS


def trainings_of(racer: Racer | AnonymousUser) -> QuerySet[TrainingJob]:
    """The racer's trainings, newest first, without what only single pages need, and without the trials of sweeps. Twin
    of :func:`can_see_training`."""
    return (
        TrainingJob.objects.filter(owner_id=racer.pk, deleted_at=None, trial=None)
        .select_related("track", "best_model", "last_model")
        .defer("log", "printed", "seen")
    )


def visible_trainings(racer: Racer | AnonymousUser) -> QuerySet[TrainingJob]:
    """All that the racer may look at: their own; for admins all. Twin of :func:`can_see_training`."""
    if racer.is_staff:
        return TrainingJob.objects.filter(deleted_at=None)
    return TrainingJob.objects.filter(owner_id=racer.pk, deleted_at=None)


def can_see_training(racer: Racer | AnonymousUser, job: TrainingJob) -> bool:
    """Whether the racer may look at the training: its owner, or an admin; nobody at a deleted one."""
    return racer.pk is not None and job.deleted_at is None and (racer.pk == job.owner_id or racer.is_staff)


def can_stop_training(racer: Racer | AnonymousUser, job: TrainingJob) -> bool:
    """Whether the racer may stop the training while it waits or runs: its owner, or an admin."""
    return not job.is_final and can_see_training(racer, job)


def can_delete_training(racer: Racer | AnonymousUser, job: TrainingJob) -> bool:
    """Whether the racer may delete the training: its owner, once it is over; a trial goes with its sweep."""
    return job.is_final and job.deleted_at is None and racer.pk == job.owner_id and job.stop_seconds is None


def minutes_used(racer: Racer, now: datetime) -> float:
    """Minutes of training since the month began, as :mod:`training.quotas` counts them."""
    return used_by(racer, MINUTES.name, now)


def minutes_left(racer: Racer, now: datetime) -> float:
    return max(0.0, limit_of(racer, MINUTES.name) - minutes_used(racer, now))


def closing_fault() -> PlatformFault | None:
    """Why no training can be queued now: ``training_paused``, ``training_unavailable``, or None."""
    if settings.TRAINING_PAUSED:
        return PlatformFault("training_paused")
    return None if settings.TRAINING else PlatformFault("training_unavailable")


def closed_because() -> str:
    """The sentence of :func:`closing_fault`; "" without one."""
    fault = closing_fault()
    return explain(fault) if fault is not None else ""


def training_quotas(racer: Racer, now: datetime) -> dict[str, Usage]:
    """The racer's use of the quotas of trainings, by name, also on a site without training."""
    counted = used_quotas([racer.pk], now)
    return {usage.name: usage for usage in usage_of(racer, now, only=counted, counted=counted)}


def how_it_ended(job: TrainingJob, reader: Racer | AnonymousUser) -> str:
    """Why the training ended, with the milliseconds of a slow reward function; "" before. Code:
    ``job.ended_because``."""
    why = _why(job, reader)
    if job.reward_ms is None or job.reward_ms < SLOW_MS or job.ended_because == EndReason.FAILED:
        return why
    slow = _("Each call of the reward function took %(ms)s ms, a fast one takes less than 1 ms.")
    return f"{why}. {slow % {'ms': f'{job.reward_ms:,.0f}'}}"


def _why(job: TrainingJob, reader: Racer | AnonymousUser) -> str:
    match job.ended_because:
        case EndReason.TIME if job.stop_seconds is not None:
            return _("Time of this rung used (%(seconds)s s)") % {"seconds": f"{job.stop_seconds:,.0f}"}
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


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    return {event.pk: {f"training:{event.subject}"} for event in events if event.kind == TRAINING_ENDED.name}


def sees_training(viewer: Viewer, key: str) -> bool:
    """Of the topic of a training."""
    return is_known(viewer) and visible_trainings(viewer).filter(public_id=key).exists()

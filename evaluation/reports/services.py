"""A car's report: asked for, driven again, stopped, deleted."""

from collections.abc import Sequence
from datetime import datetime, timedelta

from django.db import transaction
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from accounts.quotas import Quota, limit_of, used_by
from core.audit.recording import audited
from core.database.locks import hold
from paddock.errors import UserFault
from paddock.rules.race import DIRECTIONS
from paddock.rules.report import LAP, MOST_SEED
from tracks.models import Track

from ..models import State, TrainedModel
from ..models.reports import UNDER_WAY, CarReport, ReportChunk, ReportLap, TrackSet
from ..selectors import can_see_model
from .jobs import CHUNKS
from .planning import check_sensors, check_variations, chunks_of, plan, tracks_of
from .quotas import AT_ONCE, DAILY, KEPT

KEPT_DELETED = timedelta(days=1)


@transaction.atomic
def request_report(
    *,
    owner: Racer,
    model: TrainedModel,
    track_set: str = TrackSet.LEAGUE,
    tracks: Sequence[Track] = (),
    variations_on: Track | None = None,
    direction: str = "",
    seed: int = 0,
    now: datetime,
) -> CarReport:
    """Queue a report: the model on every track of a set, in both directions, and a hundred variations of a lap of
    ``variations_on`` in ``direction`` (default: the file's own), drawn from ``seed``.

    Raises UserFault ``report_model_gone``, ``report_empty``, ``report_seed``, ``report_direction``, ``report_sensors``,
    ``reports_at_once``, ``reports_a_day``, ``reports_kept``; and those of :func:`.planning.tracks_of` and
    :func:`.planning.check_variations`.
    """
    if not can_see_model(owner, model):
        raise UserFault("report_model_gone")
    check_sensors(model)
    if not 0 <= seed <= MOST_SEED:
        raise UserFault("report_seed", most=MOST_SEED)
    driven = tracks_of(track_set, tracks)
    if variations_on is not None:
        direction = direction or variations_on.direction
        if direction not in DIRECTIONS:
            raise UserFault("report_direction", known=", ".join(DIRECTIONS))
        check_variations(variations_on, direction, seed)
    laps = plan(driven, variations_on, direction)
    if not laps:
        raise UserFault("report_empty")
    hold(owner)
    for quota, code in ((AT_ONCE, "reports_at_once"), (DAILY, "reports_a_day"), (KEPT, "reports_kept")):
        _refuse_full(owner, quota, code, now)
    report = CarReport.objects.create(
        owner=owner,
        model=model,
        track_set=track_set,
        variations_on=variations_on,
        direction=direction if variations_on is not None else "",
        seed=seed,
        rules=LAP.to_dict(),
        asked_at=now,
    )
    dealt = list(chunks_of(laps, model.network.macs))
    chunks = ReportChunk.objects.bulk_create(ReportChunk(report=report, number=number) for number in range(len(dealt)))
    ReportLap.objects.bulk_create(
        ReportLap(report=report, chunk=chunk, **vars(lap))
        for chunk, some in zip(chunks, dealt, strict=True)
        for lap in some
    )
    CHUNKS.wake(times=min(len(chunks), CHUNKS.wakes))
    return report


def drive_report_again(*, report: CarReport, now: datetime) -> CarReport:
    """Queue the same report from the same seed. Raises as :func:`request_report`."""
    tracks: list[Track] = []
    if report.track_set == TrackSet.CHOSEN:
        laps = report.laps.filter(variation=None).select_related("track").order_by("number")
        tracks = list(dict.fromkeys(lap.track for lap in laps))
    return request_report(
        owner=report.owner,
        model=report.model,
        track_set=report.track_set,
        tracks=tracks,
        variations_on=report.variations_on,
        direction=report.direction,
        seed=report.seed,
        now=now,
    )


@audited("report.stopped", _("Report stopped"), target="report", unless="owner")
@transaction.atomic
def stop_report(*, report: CarReport, now: datetime) -> bool:
    """Stop an unfinished report for good. False when it had ended. Workers find their leases gone and write nothing."""
    chunks = ReportChunk.objects.filter(report=report, state__in=UNDER_WAY)
    held = list(chunks.select_for_update().order_by("pk").values_list("pk", flat=True))
    CHUNKS.end(chunks.filter(pk__in=held), state=State.STOPPED, now=now)
    stopped = CarReport.objects.filter(pk=report.pk, state__in=UNDER_WAY).update(state=State.STOPPED, ended_at=now)
    report.refresh_from_db()
    return bool(stopped)


@transaction.atomic
def delete_report(*, report: CarReport, now: datetime) -> None:
    """Delete a report that is over, with all its laps. Raises UserFault("report_under_way") for one that is not."""
    found = CarReport.objects.select_for_update().filter(pk=report.pk, deleted_at=None).first()
    if found is None:  # by another tab
        return
    if not found.is_final:
        raise UserFault("report_under_way")
    if found.is_platform_fault:  # it never counted
        found.delete()
        return
    ReportLap.objects.filter(report=found).delete()
    ReportChunk.objects.filter(report=found).delete()
    CarReport.objects.filter(pk=found.pk).update(deleted_at=now)


def purge_reports(*, now: datetime) -> int:
    """Remove what is left of deleted reports once it does not count any more. Returns how many."""
    left = CarReport.objects.filter(deleted_at__isnull=False, asked_at__lte=now - KEPT_DELETED)
    return left.delete()[0]


def _refuse_full(owner: Racer, quota: Quota, code: str, now: datetime) -> None:
    limit = limit_of(owner, quota.name)
    if used_by(owner, quota.name, now) >= limit:
        raise UserFault(code, limit=limit)

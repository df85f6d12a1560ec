"""Access to reports, their data for pages and the API, and the comparison of two."""

from dataclasses import dataclass

from django.contrib.auth.models import AnonymousUser
from django.db.models import Count, IntegerField, OuterRef, QuerySet, Subquery, Sum
from django.db.models.functions import Coalesce

from accounts.models import Racer
from paddock.errors import UserFault
from paddock.rules.report import KINDS
from tracks.models import Track

from ..models import State, TrainedModel
from ..models.reports import CarReport, ReportChunk, ReportLap
from ..selectors import visible_models
from .grading import KindSummary, Robustness, robustness_of
from .jobs import driven_laps

RELATED = ("model__owner", "model__network", "variations_on", "owner")


def reports_visible_to(racer: Racer | AnonymousUser) -> QuerySet[CarReport]:
    """Reports that the racer may read: their own, and an admin all. Twin of :func:`can_see_report`.

    Each with ``driven`` of ``laps_in_all``."""
    reports = CarReport.objects.filter(deleted_at=None).select_related(*RELATED).defer("variations_on__npy")
    if racer.pk is None:
        return reports.none()
    if not racer.is_staff:
        reports = reports.filter(owner_id=racer.pk)
    return _with_progress(reports).order_by("-asked_at", "-pk")


def can_see_report(racer: Racer | AnonymousUser, report: CarReport) -> bool:
    return racer.pk is not None and report.deleted_at is None and (racer.is_staff or racer.pk == report.owner_id)


def reports_of(racer: Racer | AnonymousUser) -> QuerySet[CarReport]:
    """The racer's own reports, those asked for last first. Twin of :func:`is_report_of`."""
    return reports_visible_to(racer).filter(owner_id=racer.pk)


def is_report_of(racer: Racer | AnonymousUser, report: CarReport) -> bool:
    """Whether the racer may drive the report again and delete it: only its owner may."""
    return can_see_report(racer, report) and racer.pk == report.owner_id


def can_stop_report(racer: Racer | AnonymousUser, report: CarReport) -> bool:
    """Whether the racer may stop the unfinished report: its owner and admins may."""
    return can_see_report(racer, report) and not report.is_final


def reportable_model(racer: Racer, public_id: str) -> TrainedModel:
    """A model that the racer may drive. Raises UserFault("report_model_gone")."""
    model = visible_models(racer).filter(public_id=public_id).first()
    if model is None:
        raise UserFault("report_model_gone")
    return model


def _with_progress(reports: QuerySet[CarReport]) -> QuerySet[CarReport]:
    mine = ReportChunk.objects.filter(report=OuterRef("pk")).order_by().values("report")
    laps = ReportLap.objects.filter(report=OuterRef("pk")).order_by().values("report")
    return reports.annotate(
        driven=Coalesce(Subquery(mine.annotate(_n=Sum("progress")).values("_n"), output_field=IntegerField()), 0),
        laps_in_all=Coalesce(Subquery(laps.annotate(_n=Count("pk")).values("_n"), output_field=IntegerField()), 0),
    )


def workers_at(report: CarReport) -> int:
    return ReportChunk.objects.filter(report=report, state=State.RUNNING).count()


@dataclass(frozen=True)
class TrackRow:
    """One track of a report, with its lap in each direction, the file's own first; None for one not driven yet."""

    track: Track
    laps: list[ReportLap]


@dataclass(frozen=True)
class ReportFigures:
    tracks: list[TrackRow]
    robustness: Robustness | None
    varied: list[ReportLap]

    @property
    def complete(self) -> int:
        return sum(bool(lap.complete) for row in self.tracks for lap in row.laps)

    @property
    def on_tracks(self) -> int:
        return sum(len(row.laps) for row in self.tracks)


def figures_of(report: CarReport) -> ReportFigures:
    laps = list(report.laps.select_related("track").defer("track__npy").order_by("number"))
    by_track: dict[int, TrackRow] = {}
    for lap in laps:
        if lap.variation is None:
            by_track.setdefault(lap.track_id, TrackRow(lap.track, [])).laps.append(lap)
    varied = [lap for lap in laps if lap.variation is not None]
    return ReportFigures(list(by_track.values()), robustness_of(driven_laps(laps)), varied)


@dataclass(frozen=True)
class KindPair:
    """A kind of variation in both; ``kind`` is empty for all of them."""

    kind: str
    mine: KindSummary
    other: KindSummary


@dataclass(frozen=True)
class LapPair:
    """A lap that both drove. ``gap_ms``: by how much the other was slower, None where one did not come round."""

    mine: ReportLap
    other: ReportLap

    @property
    def gap_ms(self) -> int | None:
        if not (self.mine.complete and self.other.complete):
            return None
        return (self.other.time_ms or 0) - (self.mine.time_ms or 0)


@dataclass(frozen=True)
class Compared:
    """``same_variations``: whether both drove the very same ones."""

    other: CarReport
    kinds: list[KindPair]
    laps: list[LapPair]
    same_variations: bool


def compared(mine: CarReport, figures: ReportFigures, other: CarReport, others: ReportFigures) -> Compared:
    one, two = figures.robustness, others.robustness
    kinds = []
    if one is not None and two is not None:
        kinds = [KindPair("", one.overall, two.overall)]
        kinds += [KindPair(kind, a, b) for kind, a, b in zip(KINDS, one.kinds, two.kinds, strict=True)]
    theirs = {(lap.track_id, lap.direction): lap for row in others.tracks for lap in row.laps}
    laps = [
        LapPair(lap, theirs[lap.track_id, lap.direction])
        for row in figures.tracks
        for lap in row.laps
        if (lap.track_id, lap.direction) in theirs
    ]
    same = (mine.variations_on_id, mine.direction, mine.seed) == (other.variations_on_id, other.direction, other.seed)
    return Compared(other, kinds, laps, same)

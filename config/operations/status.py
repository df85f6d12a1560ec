"""The public status page: how long results take, what waits, and which parts of the site work."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from html import escape

from django.db.models import Count, Q
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from core.database.clock import database_now
from core.pages.charts import Chart
from core.streams.shared_pieces import shared_value
from core.templatetags.formats import day as day_words
from evaluation.models import Evaluation, State
from races.models import ServiceDay
from races.runs.service_days import DAYS

from .health import NOBODY_CAME, readiness

CHART = Chart("progress-chart", 860, 220, left=58, right=40, top=14, bottom=30)
PARTS = {
    "web": gettext_lazy("Web server"),
    "workers": gettext_lazy("Workers"),
    "broker": gettext_lazy("Broker"),
    "storage": gettext_lazy("File storage"),
    "database": gettext_lazy("Database"),
}


@dataclass(frozen=True)
class ServiceStatus:
    """``parts``: by name, whether each works; ``stuck``: runs that wait for more than a minute."""

    parts: dict[str, bool]
    waiting: int
    running: int
    stuck: int
    days: Sequence[ServiceDay]

    @property
    def all_parts_work(self) -> bool:
        return all(self.parts.values())

    @property
    def is_well(self) -> bool:
        return self.all_parts_work and not self.stuck

    @property
    def latest(self) -> ServiceDay | None:
        """The newest day with runs."""
        return next((one for one in reversed(self.days) if one.runs), None)

    @property
    def faults(self) -> int:
        return sum(one.faults for one in self.days)

    @property
    def given_back(self) -> int:
        return sum(one.given_back for one in self.days)


def service_status() -> ServiceStatus:
    """The state now, read once for all readers: two queries beside the checks of readiness."""
    return shared_value("service status", _read)


def _read() -> ServiceStatus:
    now = database_now()
    stuck = Q(state=State.QUEUED, queued_at__lt=now - NOBODY_CAME)
    counts = Evaluation.objects.filter(state__in=(State.QUEUED, State.RUNNING)).aggregate(
        waiting=Count("pk", filter=Q(state=State.QUEUED)),
        running=Count("pk", filter=Q(state=State.RUNNING)),
        stuck=Count("pk", filter=stuck),
    )
    works = readiness().parts
    days = list(ServiceDay.objects.filter(day__gt=(now - timedelta(days=DAYS)).date()).order_by("day"))
    return ServiceStatus({name: works.get(name, True) for name in PARTS}, **counts, days=days)


def status_chart(days: Sequence[ServiceDay]) -> str:
    """Median and 95th percentile by day as an SVG; ``""`` without runs."""
    shown = [one for one in days if one.p95_ms is not None]
    if not shown:
        return ""
    most = max(one.p95_ms or 0 for one in shown) or 1
    places = {one.day: (number + 0.5) / len(days) for number, one in enumerate(days)}
    parts = [CHART.begin(_("Time from a submission to its result, by day"))]
    parts.append(CHART.scale((1 - share, f"{most * share / 1000:.1f} s") for share in (0, 0.5, 1)))
    for name in ("p50_ms", "p95_ms"):
        points = [(places[one.day], 1 - getattr(one, name) / most) for one in shown]
        parts.append(f'<path class="chart-line {name}" d="{CHART.line(points)}"/>')
        for (x, y), one in zip(points, shown, strict=True):
            title = f"{day_words(one.day)}: {getattr(one, name) / 1000:.1f} s"
            place = f'cx="{CHART.x(x):.1f}" cy="{CHART.y(y):.1f}"'
            parts.append(f'<circle class="chart-point {name}" {place} r="4"><title>{escape(title)}</title></circle>')
    marked = [days[0], days[len(days) // 2], days[-1]] if len(days) > 2 else [shown[-1]]
    parts.append(CHART.labels((places[one.day], day_words(one.day)) for one in marked))
    return "".join((*parts, "</svg>"))

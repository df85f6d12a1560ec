"""The audit of the reward function in the editor, and its report as pages show it."""

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from operator import itemgetter

from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, JsonResponse, QueryDict
from django.template.loader import render_to_string
from django.utils.functional import Promise
from django.utils.safestring import mark_safe
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_POST

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.forms import explain
from core.pages.charts import Chart
from paddock.errors import PaddockError, PlatformFault
from paddock.rules.hyperparameters import HYPERPARAMETERS, PPO
from races.models import RaceType
from tracks.models import Direction, Track

from ..check_slots import described, described_refusal
from .services import audited

DRIVE_NAMES = {
    "fast": gettext_lazy("Fast lap"),
    "slow": gettext_lazy("Slow lap"),
    "off_line": gettext_lazy("Off the centre line"),
    "zig_zag": gettext_lazy("Zig-zag"),
    "cutting": gettext_lazy("Cutting corners"),
    "crash": gettext_lazy("Leaving the road"),
    "standing": gettext_lazy("Almost standing"),
    "circles": gettext_lazy("Circles"),
}
CRASHED = gettext_lazy("Crash")
ENDED = {
    "off_track": gettext_lazy("off the track"),
    "crashed": gettext_lazy("crashed"),
    "reversed": gettext_lazy("drove backwards"),
    "time_up": gettext_lazy("time up"),
    "immobilized": gettext_lazy("stood still"),
}
_DISCOUNT = HYPERPARAMETERS["discount_factor"]
DEFAULT_DISCOUNT: float = _DISCOUNT.usual[PPO]
DEFAULT_TRACK = "oval"


@login_required
@require_POST
def reward_audit(request: HttpRequest) -> JsonResponse:
    """Audit the function of the editor; 409 during another check of the racer, 503 after a fault of the platform."""
    audit, status = audit_of(racer_of(request), request.POST)
    answer = {"html": render_to_string("training/rewards/parts/audit.html", {"audit": audit}, request)}
    return JsonResponse(answer | {"problems": audit["problems"], "warnings": audit["warnings"]}, status=status)


def audit_of(owner: Racer, form: QueryDict) -> tuple[dict[str, object], int]:
    """The report on the function of a form, on the form's track and for its race type and discount factor; and the HTTP
    status."""
    from ..laboratory.heat_map import number  # numpy and maps, which no other page of the editor needs

    direction, race_type = form.get("direction", ""), form.get("race_type", "")
    tracks = Track.objects.exclude(length_m=None)
    track = tracks.filter(slug=form.get("track", "")).first() or tracks.filter(slug=DEFAULT_TRACK).first()
    try:
        if track is None:
            raise PlatformFault("reward_check_failed")
        audit = audited(
            owner=owner,
            code=form.get("reward_code", ""),
            track=track,
            direction=direction if direction in Direction.values else Direction.CCW,
            race_type=race_type if race_type in RaceType.values else RaceType.TIME_TRIAL,
            discount=_discount(form.get("discount_factor", "")),
        )
    except PaddockError as fault:
        problem, status = described_refusal(fault)
        return {"problems": [problem], "warnings": []}, status
    names = {row.drive.name: drive_name(row.drive.name, row.drive.ended) for row in audit.rows}
    shown = [
        {
            "row": row,
            "name": names[row.drive.name],
            "ended": ENDED.get(row.drive.ended, row.drive.ended),
            "step": number(row.step),
            "worth": number(row.worth),
        }
        for row in sorted(audit.rows, key=lambda row: row.by_time)
    ]
    ranks = [(str(names[row.drive.name]), row.by_time, row.by_reward) for row in audit.rows if row.reached]
    title, heads = (
        _("Ranks of the drives by time and by reward"),
        {"by_time": _("By time"), "by_reward": _("By reward")},
    )
    return {
        "problems": [
            {**described(each.problem), "count": each.count, "drive": names.get(each.drive or ""), "step": each.step}
            for each in audit.failures
        ],
        "warnings": [described(warning) for warning in audit.warnings],
        "findings": [
            {"verdict": each.verdict, "code": each.fault.code, "message": explain(each.fault)}
            for each in audit.findings
        ],
        "rows": shown,
        "chart": mark_safe(rank_chart(ranks, title=title, **heads)) if len(ranks) > 1 else "",
        "printed": audit.printed,
        "track": track.name,
    }, 200


def drive_name(name: str, ended: str) -> Promise:
    return CRASHED if ended == "crashed" else DRIVE_NAMES[name]


def _discount(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return DEFAULT_DISCOUNT
    return value if (_DISCOUNT.least or 0.0) <= value <= (_DISCOUNT.most or 1.0) else DEFAULT_DISCOUNT


LINE_PX = 26
CHART = Chart("audit-chart", 376, 42, left=148, right=148, top=34, bottom=8)  # without a drive


def rank_chart(rows: Sequence[tuple[str, int, int]], *, title: str, by_time: str, by_reward: str) -> str:
    """``rows``: name, rank by time and rank by reward of each drive, the best first; at least two. The texts are those
    of the chart for screen readers and of its columns."""
    chart = replace(CHART, height=CHART.height + LINE_PX * len(rows))
    places = [[row[0] for row in sorted(rows, key=itemgetter(rank))] for rank in (1, 2)]
    parts = [
        chart.begin(title),
        f'<text class="audit-head left" x="{chart.x(0) - 10}" y="20">{escape(by_time)}</text>',
        f'<text class="audit-head right" x="{chart.x(1) + 10}" y="20">{escape(by_reward)}</text>',
    ]
    for name, time, reward in rows:
        a, b = ((names.index(name) + 0.5) / len(rows) for names in places)
        style = "up" if reward < time else "down" if reward > time else "level"
        sides = ((0, a, f"{escape(name)} <tspan>{time}</tspan>"), (1, b, f"<tspan>{reward}</tspan> {escape(name)}"))
        parts.append(
            f'<g class="audit-drive {style}"><title>{escape(name)}: {time} → {reward}</title>'
            f'<path d="{chart.line([(0, a), (1, b)])}"/>'
            + "".join(
                f'<circle cx="{chart.x(side)}" cy="{chart.y(place):.1f}" r="4"/>'
                f'<text class="{("left", "right")[side]}" x="{chart.x(side) + (-10, 10)[side]}" '
                f'y="{chart.y(place) + 4.5:.1f}">{text}</text>'
                for side, place, text in sides
            )
            + "</g>"
        )
    return "".join((*parts, "</svg>"))

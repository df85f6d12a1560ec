"""The telemetry of the runs on a page."""

import json
from collections.abc import Sequence

from django import template
from django.http import QueryDict
from django.template import Context
from django.template.loader import render_to_string
from django.templatetags.static import static
from django.urls import reverse
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _

from core.streams.shared_pieces import lasting_value
from paddock.errors import PaddockError
from races.replays.comparison import best_lap
from races.replays.views import ReplayedRun
from races.telemetry.document import (
    AskedLap,
    LossDocument,
    MiniSectorDocument,
    TelemetryDocument,
    document_key,
    telemetry_document,
)
from races.telemetry.rewards import reward_functions
from races.telemetry.selectors import REFERENCE, asked_lap, asked_reference

register = template.Library()


@register.simple_tag(takes_context=True)
def telemetry_panel(context: Context, runs: Sequence[ReplayedRun]) -> SafeString:
    """Charts, mini-sectors and losses of the laps of ``runs``, of the best lap of a run that is shown whole, drawn once
    for all readers of the same charts. Nothing where a trace cannot be read."""
    if not all(each.run.result.laps for each in runs):
        return SafeString()
    laps = [asked_lap(each.run, each.lap) for each in runs]
    names = [each.name for each in runs]
    if len(runs) == 1 and (reference := asked_reference(runs[0].run)):
        laps.append(reference)
        names.append(reference.name)
    shown = _shown_lap(runs, laps[0])
    rewarded = bool(reward_functions([each.run for each in runs], context["user"]))
    key = "telemetry panel", document_key(laps), tuple(names), shown, rewarded
    try:
        panel = "races/telemetry/panel.html"
        return lasting_value(key, lambda: render_to_string(panel, _panel(laps, names, shown, rewarded)))
    except PaddockError:
        return SafeString()


def _panel(laps: Sequence[AskedLap], names: Sequence[str], shown_lap: str, rewarded: bool) -> dict[str, object]:
    document = telemetry_document(laps)
    query = _query(laps)
    first = laps[0].run
    setup = {
        "url": f"{reverse('telemetry', args=[first])}?{query}",
        "rewarded": rewarded,
        "plot": static("vendor/uplot.iife.min.js"),
        "words": _words(),
    }
    against = document["against"]
    return {
        "setup": json.dumps(setup),
        "csv": f"{reverse('telemetry_csv', args=[first])}?{query}{'&reward=1' * rewarded}",
        "document": document,
        "runs": [
            {"number": number, "name": name, "telemetry": shown, "sectors": _row(document["sectors"], number)}
            for number, (name, shown) in enumerate(zip(names, document["runs"], strict=True))
        ],
        "losses": [(loss, _moment(laps, loss)) for loss in document["losses"]],
        "shown_lap": shown_lap,
        "against": against and _against(document, against["lap"], names),
        "places": _places(document),
    }


def _shown_lap(runs: Sequence[ReplayedRun], first: AskedLap) -> str:
    """Which laps are shown, where the page does not say so."""
    words = _words()
    if len(runs) > 1:
        return "" if runs[0].lap else words["best_laps"]
    return words["best_lap" if first.number == best_lap(first.laps) else "some_lap"] % first.number


def _against(document: TelemetryDocument, other_lap: int, names: Sequence[str]) -> str:
    """The laps of which the losses are the difference."""
    text = _words()["against" if len(names) > 1 else "against_best"]
    lap = document["runs"][0]["lap"]
    return text % {"name": names[0], "lap": lap, "other": names[min(1, len(names) - 1)], "other_lap": other_lap}


def _query(laps: Sequence[AskedLap]) -> str:
    query = QueryDict(mutable=True)
    query["lap"] = str(laps[0].number)
    if len(laps) > 1:
        query["with"] = ",".join(lap.run if lap.run == REFERENCE else f"{lap.run}:{lap.number}" for lap in laps[1:])
    return query.urlencode(safe=":,")


def _moment(laps: Sequence[AskedLap], loss: LossDocument) -> str:
    """The replay of these laps where a loss begins."""
    address = reverse("replay", args=[laps[0].run])
    return f"{address}?{_query([lap for lap in laps if lap.run != REFERENCE])}&t={loss['t_ms'] / 1000:.2f}"


def _row(sectors: Sequence[MiniSectorDocument], number: int) -> list[tuple[MiniSectorDocument, int | None, str]]:
    """The mini-sectors of one run: each with its time and colour."""
    return [(sector, sector["times"][number], sector["colours"][number]) for sector in sectors]


def _places(document: TelemetryDocument) -> list[dict[str, object]]:
    """The channels where each mini-sector ends."""
    metres, last = document["metres"], len(document["metres"]) - 1
    rows = []
    for sector in document["sectors"]:
        at = round(last * sector["number"] / len(document["sectors"]))
        values = [
            (run["ms"][at], run["delta_ms"][at], run["driven_speed"][at], run["driven_steer"][at], run["offset"][at])
            for run in document["runs"]
        ]
        rows.append({"metres": metres[at], "runs": values})
    return rows


def _words() -> dict[str, str]:
    """The texts that the script writes."""
    return {
        "speed": _("Speed"),
        "steer": _("Steering"),
        "delta": _("Time delta"),
        "offset": _("Offset from the centre line"),
        "curvature": _("Curvature"),
        "reward": _("Reward"),
        "turn": _("Turn"),
        "some_lap": _("Lap %s"),
        "best_lap": _("Lap %s (best lap)"),
        "best_laps": _("The best lap of each run"),
        "against": _("%(name)s, lap %(lap)s, against %(other)s, lap %(other_lap)s"),
        "against_best": _("Lap %(lap)s against the best lap, %(other_lap)s"),
        "later": _("above 0: later"),
        "left": _("above 0: left"),
        "failed": _("The telemetry could not be loaded."),
        "rewarding": _("Computing the rewards…"),
        "unrewarded": _("The rewards could not be computed."),
    }

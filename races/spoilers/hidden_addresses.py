"""Addresses that show results, with their races: hidden races hide the address's content from a reader.

Rooms above register their own. Every other address either shows no results or leaves hidden ones out itself
(``tests/pages/test_spoilers.py`` has both lists, and refuses an address that is in none).
"""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from django.db.models import Q
from django.http import HttpRequest

from evaluation.models import Evaluation

from ..models import Duel, Race, Submission

# Maps a request and its URL arguments to the ids of the races whose results it shows.
Scope = Callable[[HttpRequest, Mapping[str, Any]], Iterable[int]]
SCOPES: dict[str, Scope] = {}


def register_scope(scope: Scope, *names: str) -> None:
    """Say of addresses, by their names, which races they show results of. Registering one twice changes nothing."""
    for name in names:
        SCOPES[name] = scope


def _of_race(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    return Race.objects.filter(slug=named["slug"]).values_list("pk", flat=True)


def _of_runs(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    wanted = [named[name] for name in ("public_id", "other_id") if name in named]
    return races_of_runs(Q(public_id__in=wanted))


def _of_replays(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    """The run of the address, and those of ``with`` by their ids or links."""
    beside = re.findall(r"[\w-]{6,64}", " ".join(request.GET.getlist("with")), re.ASCII)
    return races_of_runs(Q(public_id__in=[named["public_id"], *beside]))


def _of_videos(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    return races_of_runs(Q(videos__public_id=named["public_id"]))


def races_of_runs(wanted: Q) -> set[int]:
    """The races that runs were driven in."""
    runs = Evaluation.objects.filter(wanted).values("pk")
    sent = Submission.objects.filter(evaluation__in=runs).values_list("entry__race", flat=True)
    return {*sent, *Duel.objects.filter(evaluation__in=runs).values_list("race", flat=True)}


def register() -> None:
    """The addresses of this room."""
    register_scope(
        _of_race,
        *("race_duels", "race_runs", "race_live", "race_laps", "race_laps_csv"),
        *("board_csv", "board_json", "board_atom", "board_badge", "race_results_pdf", "race_certificate"),
        *("live_event", "live_state", "live_results_csv", "live_laps_csv"),
        *("live_screen", "live_overlay", "live_commentary", "live_phone"),
        *("api-board", "api-duels", "api-live", "api-live-poses", "api-timed-sessions", "api-timed-session"),
        *("api-live-figures", "api-live-highlights", "api-live-results", "api-live-laps"),
        *("api-results-pdf", "api-certificate"),
        *("api-lap-file", "api-lap", "api-entry", "api-submissions"),
    )
    register_scope(
        _of_runs,
        *("evaluation", "evaluation_live"),
        *("evaluation_seen", "evaluation_saw", "evaluation_attention"),
        *("evaluation_trace", "evaluation_metrics", "evaluation_logs"),
        *("api-evaluation", "api-metrics", "api-evaluation-compare", "api-layout", "api-evaluation-logs"),
        *("api-trace", "api-videos"),
    )
    register_scope(_of_replays, *("replay", "evaluation_replay", "telemetry", "telemetry_csv", "api-telemetry"))
    register_scope(_of_videos, *("video_live", "video_file", "video_poster", "api-video", "api-video-file"))

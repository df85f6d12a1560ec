"""``python -m benchmarks.reads [--json]``: what each page, file and operation costs a guest.

All GET routes of the URL resolver, with real objects of a site where much has happened, on a SQLite database of its
own. Milliseconds of the processor: the first read, and the least of the next reads, each with another parameter that no
view reads. A read may cost :data:`LIMIT_MS`, or :data:`RATIO` bare views on a slower machine.
"""

from __future__ import annotations

import logging
import re
import sys
import time
from collections.abc import Iterator
from itertools import islice, product
from typing import Any

from .board import database
from .report import command, report

LIMIT_MS = 50.0
RATIO = 250.0  # times a view without session and database
RUNS = 4
TRIES = 600
SLOWEST = 40
BARE = "/health/live"
# Names in addresses for which there are values
_NAMES = frozenset(
    ("slug", "public_id", "other_id", "alias", "race", "day", "form", "number", "name", "piece", "pk", "stage")
)
# Other sites' pages, and those that have no content of ours
_SKIPPED = ("admin/", "accounts/", "__")


def measure(runs: int = RUNS) -> dict[str, Any]:
    """``routes``: for each what was read, with ``first_ms``, ``next_ms`` and ``ratio``; ``unread``: those to which a
    guest found nothing."""
    from django.test import Client
    from django.urls import get_resolver

    fill()
    logging.disable(logging.WARNING)
    client, values = Client(raise_request_exception=False), _values()
    bare = min(_cost(client, BARE)[0] for _ in range(20))
    routes, unread = {}, []
    for pattern, names in _routes(get_resolver().url_patterns):
        if pattern.startswith(_SKIPPED):
            continue
        found: dict[str, Any] | None = None
        for words in islice(product(*(values[name] for name in names)), TRIES):
            address = "/" + pattern % dict(zip(names, words, strict=True))
            first, status = _cost(client, address)
            if status == 200:
                following = [_cost(client, f"{address}?unread={number}")[0] for number in range(runs)]
                least = min(following)
                if found is None or least > found["next_ms"]:
                    found = {"address": address, "first_ms": first, "next_ms": least, "ratio": least / bare}
                if address.count("/") > 2 and len(names) and found is not None and words[0] != values[names[0]][-1]:
                    continue
        if found is None:
            unread.append(pattern)
        else:
            routes[pattern] = found
    return {"bare_ms": bare, "routes": routes, "unread": unread}


def fill() -> None:
    """The catalogue's tracks, and a site where a season has run for a month."""
    from config.celery import app as celery_app
    from tests.pages.walk import make_site
    from tracks.services import load_catalogue

    celery_app.conf.update(broker_url="memory://", task_always_eager=False)
    load_catalogue()
    make_site()


def _cost(client: Any, address: str) -> tuple[float, int]:
    began = time.process_time()
    answer = client.get(address)
    if answer.streaming:
        b"".join(answer.streaming_content)
    return (time.process_time() - began) * 1000, answer.status_code


def _values() -> dict[str, list[Any]]:
    """What to put into each name of an address."""
    from accounts.models import Racer, RacerGroup, Team
    from config.guides.pages import GUIDES
    from core.jobs.queues import all_queues
    from evaluation.models import Evaluation
    from evaluation.models import TrainedModel as TrainedModel
    from league.models import Cup, Season
    from races.models import Race
    from tracks.drawing.printing import FORMS
    from tracks.models import Track
    from training.lessons.catalogue import LESSONS
    from videos.models import Video

    tracks = sorted(Track.objects.all(), key=lambda track: -(track.length_m or 0))
    slugs = [
        *("real-race", "open-race", "robin", "show-race", "video-race"),
        *Season.objects.values_list("slug", flat=True),
        *(tracks[0].slug, tracks[len(tracks) // 2].slug),
        *Race.objects.filter(round__isnull=False).values_list("slug", flat=True)[:2],
        *(lesson.slug for lesson in LESSONS[:2]),
        *(guide.slug for guide in GUIDES),
        *Team.objects.values_list("slug", flat=True),
        *RacerGroup.objects.values_list("slug", flat=True),
    ]
    finished = Evaluation.objects.filter(state="finished").order_by("-pk")
    ids = [
        *finished.values_list("public_id", flat=True)[:8],
        *TrainedModel.objects.values_list("public_id", flat=True)[:3],
        *Video.objects.values_list("public_id", flat=True)[:2],
    ]
    aliases = ["alice", "bob", "rival-1"]
    words = {
        "slug": slugs,
        "public_id": ids,
        "other_id": ids,
        "alias": aliases,
        "race": slugs,
        "day": [str(day) for day in Cup.objects.values_list("day", flat=True)],
        "form": ["csv", "atom", "json", *FORMS],
        "number": [1],
        "name": [queue.kind.queue for queue in all_queues()],
        "piece": ["tower", "map", "standings"],
        "pk": [1, 2],
        "rest": [""],
        "stage": ["open", "pro", "qualifier", "finale"],
    }
    assert Racer.objects.exists()
    return words


def _routes(patterns: list[Any], before: str = "") -> Iterator[tuple[str, list[str]]]:
    """Each route that can be made of :func:`_values`, as a format string with the names in it."""
    from django.urls import URLResolver
    from django.urls.resolvers import RoutePattern

    for each in patterns:
        if isinstance(each, URLResolver):
            yield from _routes(each.url_patterns, before + str(each.pattern))
            continue
        names = [*each.pattern.converters] or [*each.pattern.regex.groupindex]
        if set(names) <= _NAMES:
            text = str(each.pattern) if isinstance(each.pattern, RoutePattern) else _plain(each.pattern.regex.pattern)
            yield before + _formatted(text), names


def _plain(pattern: str) -> str:
    text = re.sub(r"\(\?P<(\w+)>[^)]*\)", r"<\1>", pattern)
    return text.replace("^", "").replace("$", "").replace("\\", "")


def _formatted(route: str) -> str:
    return re.sub(r"<(?:\w+:)?(\w+)>", r"%(\1)s", route)


def misses(figures: dict[str, Any]) -> list[str]:
    """The reads that cost more than they may."""
    return [
        f"/{pattern}: {one['next_ms']:.0f} ms, {one['ratio']:.0f} bare views"
        for pattern, one in figures["routes"].items()
        if one["next_ms"] > LIMIT_MS and one["ratio"] > RATIO
    ]


def table(figures: dict[str, Any]) -> str:
    """The most expensive reads."""
    lines = [f"a bare view {figures['bare_ms']:.2f} ms; {'first':>50}{'next':>10}{'ratio':>8}"]
    slowest = sorted(figures["routes"].values(), key=lambda one: -one["next_ms"])[:SLOWEST]
    lines += [
        f"{one['address']:70}{one['first_ms']:>8.1f}{one['next_ms']:>10.1f}{one['ratio']:>8.0f}" for one in slowest
    ]
    lines.append(f"{len(figures['routes'])} routes were read, {len(figures['unread'])} have nothing for guests")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Set up a database, measure, print; 1 when a promise is not kept."""
    parser = command("reads", "What each read costs a guest.")
    parser.add_argument("--runs", type=int, default=RUNS)
    options = parser.parse_args(arguments)
    with database(False):
        figures = measure(options.runs)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())

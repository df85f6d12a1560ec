"""What a storm over a whole site begins with and what came of it: ``python -m tests.config.site_storm prepare|audit``.

A program of its own, since it works on the database of a site and not on that of a test. It prints one JSON object.
"""

from __future__ import annotations

import io
import json
import os
import sys
from datetime import timedelta
from typing import Any

import django

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
django.setup()

import onnx  # noqa: E402
from django.db.models import Count, F, Max  # noqa: E402
from django.utils import timezone  # noqa: E402
from onnx import numpy_helper  # noqa: E402

from accounts.tokens.services import create_token  # noqa: E402
from core.wakeups import workers as wakeup  # noqa: E402
from evaluation.garage.services import upload_model  # noqa: E402
from evaluation.models import Evaluation, Result, State  # noqa: E402
from paddock.packages.read import UploadPart  # noqa: E402
from races.models import Entry, Submission  # noqa: E402
from tests.factories import a_race, a_racer  # noqa: E402
from tests.shared import CHECKOUT  # noqa: E402
from tracks.models import Track  # noqa: E402

HOUSE_CARS = CHECKOUT / "training" / "house_cars"


def prepare(racers: int, races: int) -> dict[str, Any]:
    """So many racers with a car each, no two alike, and so many races of one lap on one track: a car has one result in
    all of them."""
    now = timezone.now()
    wakeup.send = lambda *_, **__: None
    track = Track.objects.get(slug="oval")
    rules = {"laps": 1, "minimum_laps": 1, "shared_cars": True, "closes_at": now + timedelta(days=30)}
    open_races = [a_race(now, track=track, slug=f"storm-{number}", **rules) for number in range(races)]
    cars = {}
    for number in range(racers):
        racer = a_racer(f"storm-{number}")
        model = upload_model(owner=racer, files=_car(number), now=now).model
        cars[create_token(racer=racer, now=now)[1]] = model.public_id
    return {"cars": cars, "races": [race.slug for race in open_races]}


def _car(number: int) -> list[UploadPart]:
    """The steady house car with a last layer that is a little different for each number."""
    network = onnx.load(HOUSE_CARS / "steady.onnx")
    for weights in network.graph.initializer:
        if weights.name == "head_bias":
            changed = numpy_helper.to_array(weights).copy()
            changed[0] += number * 1e-3
            weights.CopyFrom(numpy_helper.from_array(changed, "head_bias"))
    metadata = (HOUSE_CARS / "steady.json").read_bytes()
    content = network.SerializeToString()
    return [
        UploadPart(f"car-{number}.onnx", io.BytesIO(content)),
        UploadPart("model_metadata.json", io.BytesIO(metadata)),
    ]


def audit() -> dict[str, Any]:
    """What stands in the database of the races of the storm."""
    mine = Submission.objects.filter(entry__race__slug__startswith="storm-")
    runs = Evaluation.objects.filter(pk__in=mine.values("evaluation_id"))
    ended = runs.filter(state=State.FINISHED)
    waits = ended.annotate(waited=F("ended_at") - F("queued_at")).aggregate(longest=Max("waited"))["longest"]
    hashes = Result.objects.filter(evaluation__in=runs).values("evaluation__model__network_id")
    differing = hashes.annotate(kinds=Count("trace_sha256", distinct=True)).filter(kinds__gt=1)
    entries = Entry.objects.filter(race__slug__startswith="storm-")
    return {
        "submissions": mine.count(),
        "submitted": sorted(runs.values_list("public_id", flat=True)),
        "states": dict(runs.values_list("state").annotate(count=Count("pk")).order_by()),
        "reasons": sorted(set(runs.exclude(reason_code="").values_list("reason_code", flat=True))),
        "results": Result.objects.filter(evaluation__in=runs).count(),
        "cars": hashes.distinct().count(),
        "cars_with_two_results": differing.count(),
        "classified": entries.filter(classified=True).count(),
        "longest_wait_s": waits.total_seconds() if waits else None,
        "most_attempts": runs.aggregate(most=Max("attempt"))["most"],
    }


def main() -> None:
    """See the module's docstring."""
    what, *numbers = sys.argv[1:]
    found = prepare(*map(int, numbers)) if what == "prepare" else audit()
    print(json.dumps(found))


if __name__ == "__main__":
    main()

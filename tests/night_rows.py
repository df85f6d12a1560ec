"""Rows of a race night on a site that runs: racers with real cars, an organiser, a race and its live event.

``python -m tests.night_rows WHAT KEY=VALUE...`` in the environment of the site; it prints what it made as JSON.
"""

from __future__ import annotations

import json
import sys
from datetime import timedelta
from io import BytesIO
from itertools import cycle
from typing import Any

import django

BACKEND = "django.contrib.auth.backends.ModelBackend"
# who drives what: a house car, and the share of its speeds that is left; None: the car of the real console
FIELD: dict[str, tuple[str | None, float]] = {
    "bob": ("flyer", 1.0),
    "carl": ("brisk", 1.0),
    "dora": ("flyer", 0.8),
    "emma": ("steady", 1.0),
    "finn": ("brisk", 0.85),
    "gina": (None, 1.0),
    "hugo": ("flyer", 0.9),
    "iris": ("brisk", 0.92),
}


def sessions(aliases: list[str]) -> dict[str, str]:
    """A session of each, as a log-in makes it: the value of its cookie."""
    from django.test import Client

    from accounts.models import Racer

    found = {}
    for alias in aliases:
        client = Client()
        client.force_login(Racer.objects.get(alias=alias), backend=BACKEND)
        found[alias] = client.cookies["sessionid"].value
    return found


def a_car(alias: str) -> Any:
    """A racer and their model, uploaded as everybody uploads."""
    from django.utils import timezone

    from accounts.models import Racer
    from evaluation.garage.services import upload_model
    from league.house_cars.services import HOUSE_CARS_DIR
    from paddock.packages.read import UploadPart
    from tests.shared import CONSOLE_CAR

    country = dict(zip(FIELD, cycle(("DE", "KR", "US", "BR")), strict=False))[alias]
    racer = Racer.objects.create_user(alias, f"{alias}@example.org", None, country=country)
    car, share = FIELD[alias]
    if car is None and CONSOLE_CAR.exists():
        files = [UploadPart("console.tar.gz", BytesIO(CONSOLE_CAR.read_bytes()))]
    else:
        car = car or "steady"
        metadata = json.loads((HOUSE_CARS_DIR / f"{car}.json").read_text())
        files = [
            UploadPart(f"{car}.onnx", BytesIO(_another((HOUSE_CARS_DIR / f"{car}.onnx").read_bytes(), alias))),
            UploadPart("model_metadata.json", BytesIO(json.dumps(_slower(metadata, share)).encode())),
        ]
    name = f"{(car or 'console').title()} of {alias}"
    return racer, upload_model(owner=racer, files=files, name=name, now=timezone.now()).model


def _another(onnx_bytes: bytes, alias: str) -> bytes:
    """The same network, but for the last digits of one weight: another model."""
    import numpy as np
    import onnx
    from onnx import numpy_helper

    model = onnx.load_from_string(onnx_bytes)
    weights = model.graph.initializer[-1]
    values = numpy_helper.to_array(weights).copy()
    if values.dtype == np.float32 and values.size:
        values.flat[0] *= 1 + 1e-6 * (1 + list(FIELD).index(alias))
    weights.CopyFrom(numpy_helper.from_array(values, weights.name))
    return model.SerializeToString()


def _slower(metadata: dict[str, Any], share: float) -> dict[str, Any]:
    actions = metadata["action_space"]
    if isinstance(actions, dict):
        actions["speed"] = {end: round(speed * share, 2) for end, speed in actions["speed"].items()}
    else:
        for action in actions:
            action["speed"] = round(action["speed"] * share, 2)
    return metadata


def a_night(
    *, cars: int = 6, choose: int = 3, attempt_s: int = 24, rounds: int = 1, starts_s: int = 1800, **plan: Any
) -> dict[str, Any]:
    """A time trial, its lobby open, everybody entered; all but the first ``choose`` have chosen a model."""
    from django.utils import timezone

    from accounts.models import Racer
    from races.entries.services.entries import enter_race
    from races.live.services import choose_model, plan_live
    from races.models import LiveEvent
    from tests.factories import a_race
    from tracks.models import Track

    now = timezone.now()
    alice = Racer.objects.filter(alias="alice").first() or Racer.objects.create_user("alice", "alice@example.org", None)
    race = a_race(
        now,
        organiser=alice,
        slug="race-night",
        name="Race night",
        sponsor="Gear & Grip",
        track=Track.objects.get(slug="oval"),
        ranking_method="best",
        minimum_laps=1,
    )
    soon = now + timedelta(minutes=30)
    event = plan_live(race=race, by=alice, now=now, starts_at=soon, rounds=rounds, attempt_ms=attempt_s * 1000, **plan)
    for number, alias in enumerate(list(FIELD)[:cars]):
        racer, model = a_car(alias)
        enter_race(race=race, racer=racer, now=now)
        if number >= choose:
            choose_model(event=event, racer=racer, model=model, now=now)
    now = timezone.now()  # uploading takes its time
    LiveEvent.objects.filter(pk=event.pk).update(
        lobby_opens_at=now - timedelta(minutes=1), starts_at=now + timedelta(seconds=starts_s)
    )
    return {"sessions": sessions(["alice", *list(FIELD)[:cars]]), "race": race.slug}


def a_field(*, cars: int = 8, laps: int = 1, **fields: Any) -> dict[str, Any]:
    """A knock-out of duels whose cars are sent to their qualifying."""
    from django.utils import timezone

    from accounts.models import Racer
    from races.entries.services.submissions import submit_model
    from tests.duels import a_duel_race
    from tracks.models import Track

    now = timezone.now()
    alice = Racer.objects.filter(alias="alice").first() or Racer.objects.create_user("alice", "alice@example.org", None)
    race = a_duel_race(
        now,
        **{"duel_format": "bracket", "duel_cars": 2, "laps": laps, "minimum_laps": 1, "ranking_method": "best"}
        | fields,
        **{"organiser": alice, "slug": "knock-out", "name": "Knock-out", "track": Track.objects.get(slug="oval")},
    )
    for alias in list(FIELD)[:cars]:
        racer = Racer.objects.filter(alias=alias).first()
        model = racer.models.first() if racer is not None else None
        if racer is None or model is None:
            racer, model = a_car(alias)
        submit_model(race=race, racer=racer, model=model, now=now)
    return {"sessions": sessions(["alice", *list(FIELD)[:cars]]), "race": race.slug}


def a_bracket(*, gap_s: int = 1, **plan: Any) -> dict[str, Any]:
    """Qualifying of the knock-out closes now, and its live event runs by itself from in some seconds."""
    from django.utils import timezone

    from races.live.services import plan_live
    from races.models import Race

    now = timezone.now()
    Race.objects.filter(slug="knock-out").update(closes_at=now + timedelta(seconds=2))
    race = Race.objects.get(slug="knock-out")
    starts = now + timedelta(seconds=5)
    plan_live(race=race, by=race.organiser, now=now, starts_at=starts, auto_run=True, gap_s=gap_s, **plan)
    return {"race": race.slug}


WHAT = {"night": a_night, "field": a_field, "bracket": a_bracket}

if __name__ == "__main__":
    django.setup()
    given = {}
    for one in sys.argv[2:]:
        key, _, value = one.partition("=")
        given[key] = json.loads(value)
    print(json.dumps(WHAT[sys.argv[1]](**given)))

"""How the site of an older version was made, which the tests upgrade: run with that version's own code.

In a checkout of that version, with this folder copied into its ``tests``:
``PADDOCK_DATA=/tmp/site python -m tests.upgrade.make site-0.1.0.tar.xz site-0.1.0.json``.
Small networks that really drove.
"""

from __future__ import annotations

import json
import os
import sqlite3
import sys
import tarfile
from contextlib import closing
from datetime import timedelta
from io import BytesIO
from pathlib import Path

from tests.upgrade.told import MOMENT, set_up, told


def make() -> None:
    """A season with a race under way, a race of a racer, cars that drove, one who withdrew, a webhook, notices."""
    import numpy as np
    from django.core.management import call_command
    from onnx import numpy_helper

    from accounts.models import Racer
    from core.events import reading
    from evaluation.garage.services import upload_model
    from evaluation.running.queue.worker import run_next_evaluation
    from league.seasons.services import demo_season as demo
    from league.webhooks.services import add_webhook
    from paddock.packages.read import UploadPart
    from races.entries.services.entries import withdraw
    from races.entries.services.submissions import submit_model
    from races.models import Race
    from races.pages.services import create_community_race
    from tests.hostile.parts import metadata, network
    from tracks.services import load_catalogue

    call_command("migrate", interactive=False, verbosity=0)
    tracks = {track.slug: track for track in load_catalogue(now=MOMENT)}
    demo.MONTHS = 2
    demo.open_demo_season(now=MOMENT - timedelta(days=10))
    racers = [
        Racer.objects.create_user(alias, f"{alias}@example.org", None, joined_at=MOMENT - timedelta(days=9))
        for alias in ("alice", "bob", "carol")
    ]
    Racer.objects.create_superuser("boss", "boss@example.org", None)
    mine = create_community_race(
        organiser=racers[0],
        now=MOMENT - timedelta(days=2),
        name="Before the upgrade",
        track=tracks["oval"],
        opens_at=MOMENT - timedelta(days=2),
        closes_at=MOMENT + timedelta(days=30),
        laps=1,
        minimum_laps=1,
        max_simulated_ms=60_000,
    )
    add_webhook(owner=racers[0], url="https://example.org/hook")
    month = Race.objects.filter(kind="league", division="open", opens_at__lte=MOMENT).latest("opens_at")
    for number, racer in enumerate(racers):
        model = network()
        draws = np.random.default_rng(number)  # cars that answer alike are one car
        for weight in model.graph.initializer:
            array = numpy_helper.to_array(weight)
            if array.dtype.kind == "f":
                moved = array + draws.normal(0.0, 0.3, array.shape).astype(array.dtype)
                weight.CopyFrom(numpy_helper.from_array(moved, weight.name))
        files = [
            UploadPart("model.onnx", BytesIO(model.SerializeToString())),
            UploadPart("model_metadata.json", BytesIO(metadata())),
        ]
        car = upload_model(owner=racer, files=files, name=f"Car {number}", now=MOMENT - timedelta(days=1)).model
        for race in (mine, month):
            submit_model(race=race, racer=racer, model=car, now=MOMENT - timedelta(hours=3 - number))
    while run_next_evaluation(worker="made"):
        pass
    withdraw(entry=mine.entries.get(racer=racers[2]), now=MOMENT - timedelta(minutes=5))
    for reader in reading.READERS:
        reading.follow(reader, now=MOMENT)


def pack(data: Path, target: Path) -> None:
    """The database, in one file, and the stored files."""
    copy = data / "packed.sqlite3"
    with closing(sqlite3.connect(data / "paddock.sqlite3")) as live, closing(sqlite3.connect(copy)) as database:
        live.backup(database)
        database.execute("PRAGMA journal_mode=DELETE")
    with tarfile.open(target, "w:xz", preset=9) as archive:
        archive.add(copy, "paddock.sqlite3")
        for name in ("secret-key", "files"):
            archive.add(data / name, name)


if __name__ == "__main__":
    set_up()
    make()
    Path(sys.argv[2]).write_text(json.dumps(told(), sort_keys=True) + "\n")
    pack(Path(os.environ["PADDOCK_DATA"]), Path(sys.argv[1]))

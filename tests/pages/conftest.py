"""A small world for the pages: who looks, and what there is to see."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from time import monotonic, sleep

import pytest
from django.core.cache import cache
from django.test import Client
from django.utils import timezone

from accounts.models import Racer
from evaluation.models import Evaluation, TrainedModel
from paddock.errors import PlatformFault, UserFault
from races.entries.services.entries import enter_race
from races.entries.services.submissions import submit_model
from races.models import Race, RankingMethod, Submission, Visibility
from tests.collected import collected
from tests.factories import a_model, a_race, a_racer, a_track, drive, fail, lap, laps, start
from tests.kept import Kept
from tests.shared import CHECKOUT
from tracks.models import Track

START_S = 90
VIEWERS = ("anonymous", "newcomer", "alice", "bob", "admin")


@pytest.fixture(autouse=True)
def _alone(wakes: list[dict]) -> None:
    """No broker, and no rate limit left over from another test."""
    cache.clear()


@dataclass
class World:
    """Alice races and organises; bob races against her; the newcomer has done nothing; the admin may see everything."""

    now: datetime
    alice: Racer
    bob: Racer
    newcomer: Racer
    admin: Racer
    track: Track
    model: TrainedModel  # alice's, not sent anywhere
    race: Race  # public and open; alice and bob are on its board, and a house car
    secret: Race  # by invitation, alice's
    upcoming: Race
    closed: Race
    cancelled: Race
    finished: Submission  # alice's on the board of ``race``
    other: Submission  # alice's in ``race`` that does not count: hers alone
    queued: Submission
    running: Submission
    failed: Submission
    ours: Submission  # failed through the platform's fault

    def client(self, viewer: str) -> Client:
        """A browser of one of the VIEWERS."""
        client = Client()
        if viewer != "anonymous":
            client.force_login(getattr(self, viewer), backend="django.contrib.auth.backends.ModelBackend")
        return client

    def evaluation(self, name: str) -> Evaluation:
        """The evaluation of one of the submissions, fresh."""
        return Evaluation.objects.get(submission=getattr(self, name))


@pytest.fixture(scope="session")
def kept_world(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, make_world, fresh_s=20.0)  # leases of the present moment run for thirty


@pytest.fixture
def world(kept_world: Kept, db: None) -> World:
    return kept_world.copy()


def make_world() -> World:
    now = timezone.now()
    alice, bob = a_racer("alice", country="KR"), a_racer("bob", country="DE")
    house = a_racer("house-steady", is_house=True)
    race = a_race(now, slug="open-race", name="Open race", organiser=alice)
    other = drive(race, alice, laps(12_000, 12_100, 12_200), now)
    finished = drive(race, alice, laps(10_000, 10_100, 10_200, resets=1), now)
    drive(race, bob, laps(11_000, 11_100, 11_200), now)
    baseline = drive(race, house, laps(10_500, 10_500, 10_500), now)
    type(baseline.entry).objects.filter(pk=baseline.entry_id).update(is_baseline=True)
    drive(race, a_racer("slowpoke"), [lap(1, 20_000), lap(2, 9_000, complete=False, percentage=40)], now)
    waits = a_race(now, slug="waiting-race", name="Waiting race", ranking_method=RankingMethod.BEST)
    running = submit_model(race=waits, racer=bob, model=a_model(bob), now=now)
    queued = submit_model(race=waits, racer=alice, model=a_model(alice), now=now)
    start(running.evaluation, now)
    progress = {"lap": 2, "laps": 3, "lap_ms": 4_000, "total_ms": 14_000, "percent": 40.0, "x": 1.0, "y": 1.0}
    progress |= {"off_tracks": 1, "resets": 1, "last_lap_ms": 10_000}
    Evaluation.objects.filter(pk=running.evaluation_id).update(progress=progress)
    faults = a_race(now, slug="fault-race", name="Fault race", ranking_method=RankingMethod.TOTAL)
    failed = submit_model(race=faults, racer=alice, model=a_model(alice), now=now)
    fail(failed, UserFault("non_finite_action", step=7), now)
    ours = submit_model(race=faults, racer=bob, model=a_model(bob), now=now)
    fail(ours, PlatformFault("internal_error"), now)
    secret = a_race(now, slug="secret-race", name="Secret race", organiser=alice, visibility=Visibility.INVITATION)
    upcoming = a_race(
        now, slug="next-race", name="Next race", opens_at=now + timedelta(days=2), closes_at=now + timedelta(days=4)
    )
    enter_race(race=upcoming, racer=alice, now=now)
    return World(
        now=now,
        alice=alice,
        bob=bob,
        newcomer=a_racer("newcomer"),
        admin=a_racer("admin-anna", is_staff=True, is_superuser=True),
        track=a_track(),
        model=a_model(alice, name="Lightning"),
        race=race,
        secret=secret,
        upcoming=upcoming,
        closed=a_race(
            now, slug="old-race", name="Old race", opens_at=now - timedelta(days=9), closes_at=now - timedelta(days=2)
        ),
        cancelled=a_race(
            now, slug="no-race", name="No race", organiser=alice, cancelled_at=now, cancel_reason="It rained."
        ),
        finished=finished,
        other=other,
        queued=queued,
        running=running,
        failed=failed,
        ours=ours,
    )


@pytest.fixture(scope="package")
def site(tmp_path_factory: pytest.TempPathFactory, new_data: Callable[..., Path]) -> Iterator[str]:
    """The address of ``manage.py run``, on a data folder that nobody had used before: one for all tests in a browser,
    where everybody signs up under a name of their own."""
    data = tmp_path_factory.mktemp("site")
    new_data(data / "data", house_cars=0)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    ours = ("PADDOCK_", "DJANGO_", "DATABASE_URL", "CELERY_", "CACHE_URL", "PYTEST_", "STORAGE")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    log = data / "run.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "manage.py", "run", "--port", str(port)],
            cwd=CHECKOUT,
            env={**environment, **collected(), "PADDOCK_DATA": str(data / "data")},
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        _wait_until_ready(f"http://127.0.0.1:{port}", process, log)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _wait_until_ready(url: str, process: subprocess.Popen, log: Path) -> None:
    deadline = monotonic() + START_S
    while monotonic() < deadline and process.poll() is None:
        try:
            with urllib.request.urlopen(f"{url}/health/ready", timeout=5):
                return
        except (urllib.error.URLError, OSError):
            sleep(0.3)
    pytest.fail(f"the site did not start:\n{log.read_text()[-3000:]}")

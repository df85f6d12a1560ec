"""Redis is gone: the site is read, logged in to and raced on; what was accepted is found once it is back."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import pytest
from redis import Redis

from config.serving import broker
from tests.evaluation.processes import suspended, wait_for
from tests.outages.small_site import Answer, SmallSite, Somebody

SWEEP = (
    "import django; django.setup()\n"
    "from evaluation.running.queue.jobs import EVALUATIONS; from core.database.clock import database_now\n"
    "print(EVALUATIONS.sweep(now=database_now()).waiting)"
)
IN_ALL = "import django; django.setup(); from races.models import Submission; print(Submission.objects.count())"


@contextmanager
def valkey(folder: Path) -> Iterator[subprocess.Popen]:
    """A server on the socket below ``folder``."""
    path = broker.socket_path(folder)
    process = subprocess.Popen(broker.server_command(folder, path), stdout=subprocess.DEVNULL)
    try:
        wait_for(path.exists, 10)
        yield process
    finally:
        process.kill()
        process.wait()
        path.unlink(missing_ok=True)


def use(somebody: Somebody, site: SmallSite, number: int) -> Iterator[tuple[str, Answer]]:
    """What people do at a site, one after the other; a car is sent to the races ``number`` and ``number + 1``."""
    evaluation, model = site.rows["evaluation"], site.rows["model"]
    pages = ("/", "/races/", "/races/race-0/", "/races/race-0/live/", f"/evaluations/{evaluation}/live/", "/models/")
    for path in (*pages, f"/models/{model}/sensors.png", "/api/v1/races/", f"/api/v1/evaluations/{evaluation}/"):
        yield path, somebody.get(path)
    stranger = Somebody(site.address)
    yield "a wrong password", stranger.log_in("a wrong guess")
    yield "log-in", stranger.log_in()
    yield "who is there", stranger.get("/api/v1/me/")
    race = f"/races/race-{number}/"
    yield "submission", stranger.post(f"{race}submit/", {"model": model}, form_at=race)
    yield "in the API", somebody.send(f"/api/v1/races/race-{number + 1}/submissions/", {"model": model})


def timed(answers: Iterator[tuple[str, Answer]]) -> tuple[dict[str, Answer], float]:
    """All of them, and how many seconds they took together."""
    began = monotonic()
    return dict(answers), monotonic() - began


@pytest.mark.slow
def test_the_site_works_without_redis_and_loses_nothing(tmp_path: Path, new_data: Callable[..., Path]) -> None:
    folder = tmp_path / "valkey"
    folder.mkdir()
    path = broker.socket_path(folder)
    urls = {"CELERY_BROKER_URL": broker.broker_url(path), "CACHE_URL": broker.cache_url(path)}
    site = SmallSite(new_data(tmp_path / "data"), **urls)
    with site.served() as somebody:
        with valkey(folder) as server:
            assert somebody.log_in().status == 200
            answers = dict(use(somebody, site, 1))
            with suspended(server.pid):  # it hangs, and every connection to it stays open
                hanging, hung_s = timed(use(somebody, site, 3))
        without, took_s = timed(use(somebody, site, 5))
        wait_for(lambda: '"cache": false' in somebody.get("/health/ready").text, 10)
        told = somebody.get("/health/ready")
        assert told.status == 503 and '"broker": false' in told.text
        for others in (hanging, without):
            assert {name: one.status for name, one in others.items()} == {n: one.status for n, one in answers.items()}
            assert max(answer.status for answer in others.values()) < 300, others
            assert '"alias":"alice"' in others["who is there"].text.replace(" ", "")
        assert took_s < 10 and hung_s < 20
        # limits hold on: wrong guesses at a name are refused, and said to be too many
        guesses = [Somebody(site.address).log_in("wrong").text for _ in range(8)]
        assert "Too many" not in guesses[0] and "Too many" in guesses[-1]
        with valkey(folder):
            assert int(site.python(IN_ALL)) == 7
            assert int(site.python(SWEEP)) == 7
            assert Redis(unix_socket_path=str(path)).llen("celery") == 7
            wait_for(lambda: '"cache": true' in somebody.get("/health/ready").text, 10)
            wait_for(lambda: Somebody(site.address).log_in().text.count("Log out"), 15)
    log = site.log.read_text()
    assert "Internal Server Error" not in log and log.count("The cache does not answer") == 1

"""A real site with metrics and a log in JSON: a run through all its processes, and a real Prometheus."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from time import monotonic

import pytest
import requests
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.parser import text_string_to_metric_families

from league.house_cars.services import HOUSE_CARS_DIR
from tests.collected import collected
from tests.config.test_monitoring import ALERTS, MONITORING, OF_PANELS
from tests.config.test_run import Run, environment, free_port, rows
from tests.evaluation.processes import wait_for
from tests.live_site import QUIET
from tests.servers import running
from tests.shared import CHECKOUT

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("run")]
TOKEN = "a-token-of-the-tests"
A_RACER = """
from django.utils import timezone
from accounts.models import Racer
from accounts.tokens.services import create_token
racer = Racer.objects.create_user("anna", "anna@example.org", None)
print(create_token(racer=racer, now=timezone.now())[1])
"""
# a mail that is due, and an event that nobody has read, of two hours ago
LATE = """
from datetime import timedelta
from django.utils import timezone
from accounts.models import Racer
from core.events.models import Event
from core.events.reading import READERS
from league.models import Mail, Notice
from league.notices.kinds import OPENS
at = timezone.now() - timedelta(hours=2)
notice = Notice.objects.create(racer=Racer.objects.get(alias="anna"), kind=OPENS, about="x", at=at)
Mail.objects.create(notice=notice)
Event.objects.create(kind=READERS["notices"].kinds[0].name, at=at, recorded_at=at)
"""
FAULTS_WAIT_S, LOCKED_S = 120, 6
NOT_FIRED = {"PaddockDiskFills"}  # promtool fires it: no test fills a real disk


class ObservedSite:
    def __init__(self, run: Run, port: int) -> None:
        self.run, self.port = run, port
        self.token = self.python(A_RACER)

    def python(self, code: str) -> str:
        """Run code in a process of the site."""
        env = environment(self.run.data) | {"DJANGO_SETTINGS_MODULE": "config.settings"}
        command = [sys.executable, "-c", f"import django\ndjango.setup()\n{code}"]
        done = subprocess.run(command, cwd=CHECKOUT, env=env, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def ask(self, method: str, path: str, request_id: str = "", **options) -> requests.Response:
        headers = {"Authorization": f"Bearer {self.token}"} | ({"X-Request-ID": request_id} if request_id else {})
        address = f"http://127.0.0.1:{self.run.port}{path}"
        return requests.request(method, address, headers=headers, timeout=60, **options)

    def a_model(self, car: str, request_id: str = "") -> dict:
        network, metadata = ((HOUSE_CARS_DIR / f"{car}.{end}").read_bytes() for end in ("onnx", "json"))
        files = {"model": (f"{car}.onnx", network), "metadata": ("model_metadata.json", metadata)}
        answer = self.ask("POST", "/api/v1/models/", request_id, files=files, data={"name": car})
        assert answer.status_code == 201, answer.text
        return answer.json()

    def a_run(self, model: dict, request_id: str = "") -> str:
        asked = {"model": model["public_id"], "track": rows(self.run.data, "select slug from tracks_track")[0][0]}
        answer = self.ask("POST", "/api/v1/evaluations/", request_id, json=asked)
        assert answer.status_code == 201, answer.text
        return answer.json()["public_id"]

    def state_of(self, run: str) -> str:
        return rows(self.run.data, f"select state from evaluation_evaluation where public_id = '{run}'")[0][0]

    def is_idle(self) -> bool:
        return not rows(self.run.data, "select 1 from evaluation_evaluation where state in ('queued', 'running')")

    def scrape(self, address: str = "", **options) -> dict[tuple[str, frozenset], float]:
        text = requests.get(address or f"http://127.0.0.1:{self.port}/metrics", timeout=20, **options).text
        families = text_string_to_metric_families(text)
        return {(one.name, frozenset(one.labels.items())): one.value for family in families for one in family.samples}

    def count(self, name: str, **labels: str) -> float:
        return self.scrape().get((name, frozenset(labels.items())), 0.0)

    def lines(self) -> list[dict]:
        """The whole lines of the log so far; the last one may still be written."""
        return [json.loads(line) for line in self.run.said.splitlines(keepends=True) if line.endswith("\n")]

    def lines_of_request(self, request_id: str) -> list[dict]:
        return [line for line in self.lines() if line["request_id"] == request_id]

    def change(self, sql: str) -> None:
        with closing(sqlite3.connect(self.run.data / "paddock.sqlite3", timeout=20)) as database, database:
            database.execute(sql)


@pytest.fixture(scope="module")
def site(tmp_path_factory, new_data) -> Iterator[ObservedSite]:
    data = new_data(tmp_path_factory.mktemp("observed") / "data", house_cars=0)
    port = free_port()
    settings = {"LOG_FORMAT": "json", "METRICS_LISTEN": f"127.0.0.1:{port}", "METRICS_TOKEN": TOKEN}
    named = {f"PADDOCK_{name}": value for name, value in settings.items()}
    with Run(data, None, **QUIET, **collected(), **named) as run:
        observed = ObservedSite(run.ready(), port)
        wait_for(observed.is_idle, 120, run.log)
        yield observed


@pytest.fixture(scope="module")
def driven(site) -> str:
    """A run that was asked for in the request ``drive-1``."""
    run = site.a_run(site.a_model("flyer", "upload-1"), "drive-1")
    wait_for(lambda: site.state_of(run) == "finished", 60, site.run.log)
    wait_for(lambda: f"Evaluation {run} ended" in site.run.said, 10, site.run.log)
    return run


def test_every_line_is_one_json_object_with_the_ids_of_request_and_job(site, driven):
    site.ask("GET", "/nowhere/", "refused-1")
    of_worker = [line for line in site.lines() if line["program"] == "worker" and line["job_id"]]
    of_run = [line for line in of_worker if line["job_id"] == f"evaluation:{driven}"]
    assert [line["message"].partition(driven)[2] for line in of_run] == [" attempt 1 starts.", " ended."]
    assert {line["request_id"] for line in of_run} == {"drive-1"}
    wait_for(lambda: site.lines_of_request("refused-1"), 20, site.run.log)
    assert [line["program"] for line in site.lines_of_request("refused-1")] == ["web"]


def test_the_counts_of_all_processes_are_in_one_scrape(site, driven):
    assert site.count("paddock_job_seconds_count", kind="evaluation", end="ended") >= 1
    assert site.count("paddock_run_part_seconds_total", part="physics") > 0
    opened = site.count("paddock_streams_opened_total")
    with requests.get(f"http://127.0.0.1:{site.run.port}/stream/", stream=True, timeout=60) as stream:
        lines = stream.iter_lines()  # without it the connection would be closed
        assert next(lines)
        wait_for(lambda: site.count("paddock_streams_open") == 1, 20, site.run.log)
    assert site.count("paddock_streams_opened_total") == opened + 1
    assert site.count("paddock_stream_messages_total") >= 1


def test_requests_to_both_web_processes_are_added_and_outlive_a_process(site):
    about = {"view": "about", "status": "2xx"}
    name = "paddock_request_seconds_count"
    before = site.count(name, **about)
    with ThreadPoolExecutor(8) as many:
        assert {answer.status_code for answer in many.map(lambda _: site.ask("GET", "/about/"), range(80))} == {200}
    assert site.count(name, **about) == before + 80
    by_token = site.scrape(f"http://127.0.0.1:{site.run.port}/metrics", headers={"Authorization": f"Bearer {TOKEN}"})
    assert by_token[name, frozenset(about.items())] == before + 80
    counting = [
        file
        for file in (site.run.data / "metrics").glob("histogram_*.db")
        if any("'about'" in str(one.samples) for one in MultiProcessCollector.merge([str(file)]))
    ]
    assert len(counting) == 2
    os.kill(site.run.pid_of("config.web"), signal.SIGKILL)
    wait_for(lambda: "web ended by itself" in site.run.said, 20, site.run.log)
    for _ in range(5):
        assert site.ask("GET", "/about/").status_code == 200
    assert site.count(name, **about) == before + 85


@pytest.fixture(scope="module")
def prometheus(site, tmp_path_factory) -> Iterator[Callable[[str], dict]]:
    """Asks a Prometheus that reads the site and the rules every second, without the rules' patience."""
    program = shutil.which("prometheus")
    if program is None:
        pytest.skip("prometheus is missing (Debian: prometheus)")
    folder: Path = tmp_path_factory.mktemp("prometheus")
    config = (MONITORING / "prometheus.yml").read_text().replace(":9464", f":{site.port}").replace("15s", "1s")
    (folder / "prometheus.yml").write_text(config)
    (folder / "alerts.yml").write_text(re.sub(r" *for: .*\n", "", (MONITORING / "alerts.yml").read_text()))
    port = free_port()
    options = {
        "config.file": folder / "prometheus.yml",
        "storage.tsdb.path": folder / "data",
        "web.listen-address": f"127.0.0.1:{port}",
    }
    command = [program, *(f"--{name}={value}" for name, value in options.items())]

    def ask(path: str, **given: str) -> dict:
        answer = requests.get(f"http://127.0.0.1:{port}/api/v1/{path}", params=given, timeout=20).json()
        assert answer["status"] == "success", answer
        return answer["data"]

    def reads() -> bool:
        try:
            return [one["value"][1] for one in ask("query", query="up")["result"]] == ["1"]
        except requests.RequestException:  # it starts
            return False

    with running(command, reads):
        yield ask


@pytest.mark.soak
def test_a_real_prometheus_reads_the_site_and_each_rule_fires(site, driven, prometheus):
    def values(expression: str) -> list:
        return prometheus("query", query=expression)["result"]

    def fired() -> set[str]:
        """The alerts that fire now, or fired."""
        return {one["metric"]["alertname"] for one in values('max_over_time(ALERTS{alertstate="firing"}[10m])')}

    wait_for(lambda: values("rate(paddock_request_seconds_count[1m])"), 60, site.run.log)
    for expression in OF_PANELS:
        prometheus("query", query=expression.replace("$__rate_interval", "1m"))
    assert fired() <= NOT_FIRED
    model = site.a_model("brisk")
    faults = (
        lambda: _fail_requests(site),
        lambda: _slow_requests(site, model),
        lambda: _damage(site, model),
        lambda: _stop_programs(site, model),
    )
    for cause in faults:
        cause()
    wait_for(lambda: fired() >= {*ALERTS} - NOT_FIRED - {"PaddockDown"}, FAULTS_WAIT_S, site.run.log)
    site.run.process.kill()
    wait_for(lambda: "PaddockDown" in fired(), 30, site.run.log)
    print("fired:", ", ".join(sorted(fired())))


def _fail_requests(site: ObservedSite) -> None:
    """PaddockErrors."""
    site.change("alter table tracks_track rename to gone")
    try:
        statuses = [site.ask("GET", "/tracks/").status_code for _ in range(30)]
    finally:
        site.change("alter table gone rename to tracks_track")
    assert {*statuses} <= {500, 503}


def _slow_requests(site: ObservedSite, model: dict) -> None:
    """PaddockSlow: writes wait for the lock of the database."""
    with closing(sqlite3.connect(site.run.data / "paddock.sqlite3", isolation_level=None)) as database:
        began = monotonic()
        with ThreadPoolExecutor(8) as many:
            database.execute("begin immediate")
            waiting = [many.submit(site.a_run, model) for _ in range(8)]
            wait_for(lambda: monotonic() > began + LOCKED_S, LOCKED_S + 10)
            database.execute("rollback")
        assert all(one.result() for one in waiting)


def _damage(site: ObservedSite, model: dict) -> None:
    """PaddockFilesDamaged, PaddockPlatformFaults."""
    network = f"select network_id from evaluation_trainedmodel where public_id = '{model['public_id']}'"
    ((name,),) = rows(site.run.data, f"select onnx from evaluation_network where sha256 = ({network})")
    (site.run.data / "files" / name).write_bytes(b"something else")
    site.a_run(model)
    of_it = {"kind": "evaluation", "reason": "file_damaged", "fault": "platform", "then": "retried"}
    wait_for(lambda: site.count("paddock_job_faults_total", **of_it) >= 4, FAULTS_WAIT_S, site.run.log)


def _stop_programs(site: ObservedSite, model: dict) -> None:
    """PaddockWorkerSilent, PaddockNoWorker, PaddockPartFails, PaddockRunsWait, PaddockMessagesWait,
    PaddockEventsLate."""
    for words in ("--without-mingle (end)", "messenger@"):
        os.kill(site.run.pid_of(words), signal.SIGSTOP)
    long_ago = "datetime('now', '-2 hours')"
    site.a_run(site.a_model("steady"))
    site.change(f"update evaluation_evaluation set queued_at = {long_ago} where state = 'queued'")
    site.change(f"update evaluation_workernode set seen_at = {long_ago}")
    site.python(LATE)

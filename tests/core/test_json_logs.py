"""The log as JSON: one object per record, which no text can forge, with the ids of request and job."""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Callable
from logging.config import dictConfig

import pytest
from django.test import Client

from config.serving.supervisor import Supervisor
from core.jobs.work import run_next
from core.logs.json_lines import JsonLines, JsonOutput, line_of
from core.logs.lines import FORMATTERS, job_id, job_in_log, request_id
from evaluation.running.queue.jobs import EVALUATIONS
from paddock.errors import PlatformFault
from tests.core.jobs.kinds import MAKERS

ALWAYS = ["time", "level", "logger", "message", "program", "process", "request_id", "job_id"]
FORGED = '{"time": "2026-01-01T00:00:00.000Z", "level": "error", "message": "forged"}'
HOSTILE = [
    f"a\n{FORGED}",
    f'a"}}\r\n{FORGED}',
    "a\x00b\x1b[31mc\x7f\x85d",
    "a\u2028b\u2029c\u202ed",
    '\\"\\u000a\\n',
    "\ud800",
]
log = logging.getLogger("test.json")


@pytest.fixture
def written(settings) -> Callable[[], list[dict]]:
    """The lines that were written since the last call."""
    out = io.StringIO()
    config = settings.LOGGING | {"formatters": {"line": {"()": FORMATTERS["json"]}}}
    console = config["handlers"]["console"] | {"stream": out}
    before = logging.getLogger().handlers[:]
    request_id.set("-")
    dictConfig(config | {"handlers": {"console": console}})

    def lines() -> list[dict]:
        found = [json.loads(line) for line in out.getvalue().splitlines()]
        out.seek(0)
        out.truncate()
        return found

    yield lines
    logging.getLogger().handlers[:] = before


def test_a_line_has_the_time_and_the_place(written):
    log.warning("A car left %s.", "the track")
    (line,) = written()
    assert list(line) == ALWAYS
    assert line["time"].endswith("Z") and len(line["time"]) == 24
    assert (line["level"], line["logger"], line["message"]) == ("warning", "test.json", "A car left the track.")
    assert line["request_id"] is line["job_id"] is None


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_makes_a_second_line(text):
    """Neither of a message, nor of an exception, nor of the name of a logger."""
    try:
        raise ValueError(text)
    except ValueError as error:
        info = (ValueError, error, error.__traceback__)
    record = logging.LogRecord(text, logging.ERROR, "f.py", 1, text, (), info)
    made = JsonLines().format(record)
    assert made.isascii() and made.isprintable() and made.splitlines() == [made]
    line = json.loads(made)
    assert (line["message"], line["logger"], line["level"]) == (text, text, "error")
    assert text in line["exception"] and list(line) == [*ALWAYS, "exception"]


def test_secrets_are_in_neither_message_nor_exception(written):
    try:
        raise ValueError("redis://:hunter2@host for anna@example.org")
    except ValueError:
        log.exception("?token=abcdef for anna@example.org")
    (line,) = written()
    assert not any(secret in str(line) for secret in ("hunter2", "anna", "abcdef"))


@pytest.mark.parametrize("sent", [*HOSTILE[:2], "x" * 65, "", "a b", "-a", "ä", '"', "a,b"])
def test_a_request_id_that_is_no_plain_word_is_replaced(written, client: Client, db, sent):
    answer = client.get("/nowhere/", headers={"X-Request-ID": sent})
    (line,) = [line for line in written() if line["logger"] == "django.request"]
    assert line["request_id"] == answer["X-Request-ID"] != sent
    assert len(line["request_id"]) == 32 and line["request_id"].isalnum()


def test_a_plain_request_id_is_answered_and_logged(written, client: Client, db):
    assert client.get("/nowhere/", headers={"X-Request-ID": "proxy-1.a_B"})["X-Request-ID"] == "proxy-1.a_B"
    assert {line["request_id"] for line in written() if line["logger"] == "django.request"} == {"proxy-1.a_B"}


def test_the_lines_of_a_job_have_its_id_also_those_of_its_heartbeat_and_its_processes(written, alice, oval, now):
    def do(job, heartbeat):
        heartbeat._context.copy().run(log.info, "from the heartbeat")
        fault = PlatformFault("runner_died")
        fault.add_note("stderr of the runner:\nTraceback")
        raise fault

    logging.getLogger().setLevel(logging.INFO)
    request_id.set("queued-1")
    run = MAKERS[EVALUATIONS](alice, oval, now)
    request_id.set("sweep-1")  # whatever woke the worker
    run_next(EVALUATIONS, do, worker="test")
    log.info("after it")
    *lines, last = written()
    of_job = [line for line in lines if line["logger"] in ("core.jobs.work", "core.jobs.retried", "test.json")]
    assert len(of_job) == 4 and {line["job_id"] for line in of_job} == {f"evaluation:{run.public_id}"}
    assert any("stderr of the runner:\nTraceback" in line["message"] for line in of_job)
    assert {line["request_id"] for line in of_job} == {"queued-1"}
    assert (last["job_id"], last["request_id"]) == (None, "sweep-1")


def test_a_job_that_raises_leaves_no_id(written):
    with pytest.raises(KeyboardInterrupt), job_in_log("evaluation:x", "y"):
        raise KeyboardInterrupt
    assert job_id.get() == request_id.get() == "-"


@pytest.mark.parametrize("text", ["plain", "{", FORGED[:-1], '{"other": 1}', "Traceback\x00"])
def test_what_a_program_prints_becomes_a_line(text):
    line = json.loads(line_of(text, "broker", 7))
    assert list(line) == ALWAYS
    assert (line["message"], line["program"], line["process"], line["logger"]) == (text, "broker", 7, "output")


def test_the_supervisor_passes_lines_of_the_log_on(capsys, monkeypatch):
    monkeypatch.setenv("PADDOCK_LOG_FORMAT", "json")
    made = JsonLines().format(logging.LogRecord("a", logging.INFO, "f.py", 1, "b", (), None))
    supervisor = Supervisor()
    for line in (made, "printed"):
        supervisor._print("web", "36", line, 12)
    first, second = capsys.readouterr().out.splitlines()
    assert first == made
    assert (json.loads(second)["message"], json.loads(second)["program"]) == ("printed", "web")


def test_the_output_of_a_command_becomes_whole_lines():
    out = io.StringIO()
    stream = JsonOutput(out)
    for text in ("Loading tracks ...", " 0.3 s\nSta", "rting\n"):
        stream.write(text)
    stream.flush()
    assert [json.loads(line)["message"] for line in out.getvalue().splitlines()] == [
        "Loading tracks ... 0.3 s",
        "Starting",
    ]

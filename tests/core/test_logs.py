"""Refused requests are one line of the log each."""

from __future__ import annotations

import io
import logging
import os
import re
import sqlite3
from collections.abc import Iterator
from copy import deepcopy
from logging.config import dictConfig
from pathlib import Path
from typing import Any

import pytest
import redis
from django.conf import settings
from django.core.exceptions import BadRequest, PermissionDenied, SuspiciousOperation
from django.core.mail import send_mail
from django.db import OperationalError, connection
from django.http import Http404, HttpRequest, HttpResponse
from django.test import Client
from django.urls import URLResolver, get_resolver, path
from kombu.exceptions import OperationalError as BrokerError

from config import urls as site
from core.logs.lines import program_of
from core.mail import FOLDER_BACKEND
from paddock.errors import PlatformFault
from tests.factories import a_racer

REFUSALS = {
    "missing": (Http404("gone"), 404),
    "forbidden": (PermissionDenied("no"), 403),
    "bad": (BadRequest("no season"), 400),
    "suspicious": (SuspiciousOperation("too many"), 400),
    "broken": (RuntimeError("our mistake"), 500),
}


def refuse(request: HttpRequest, what: str) -> HttpResponse:
    raise REFUSALS[what][0]


urlpatterns = [path("refuse/<what>/", refuse), *site.urlpatterns]


@pytest.fixture
def log() -> Iterator[io.StringIO]:
    """What the site's own handler writes."""
    written = io.StringIO()
    config = deepcopy(settings.LOGGING)
    config["handlers"]["console"]["stream"] = written
    kept = list(logging.getLogger().handlers)
    dictConfig(config)
    yield written
    logging.getLogger().handlers[:] = kept


@pytest.mark.parametrize("what", REFUSALS)
@pytest.mark.django_db
@pytest.mark.urls("tests.core.test_logs")
def test_only_a_mistake_of_ours_writes_a_traceback(log: io.StringIO, what: str) -> None:
    answer = Client(raise_request_exception=False).get(f"/refuse/{what}/")
    assert answer.status_code == REFUSALS[what][1]
    assert ("Traceback" in log.getvalue()) == (what == "broken")
    assert log.getvalue(), "the request itself is logged"


@pytest.mark.django_db
def test_a_refused_page_of_the_site_is_one_line(log: io.StringIO) -> None:
    client = Client()
    client.force_login(a_racer("alice"), "django.contrib.auth.backends.ModelBackend")
    for address, status in (("/seasons/new/", 403), ("/races/none/", 404), ("/api/v1/races/none/", 404)):
        log.truncate(log.seek(0))
        assert client.get(address).status_code == status
        assert log.getvalue().count("\n") == 1, log.getvalue()


SECRETS = {"token", "key", "code", "claim", "uidb36"}
LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z [\w-]+\[(\d+)\] (\S+) .*")


@pytest.mark.django_db
@pytest.mark.urls("tests.core.test_logs")
def test_every_line_has_time_process_and_request(log: io.StringIO) -> None:
    client = Client(raise_request_exception=False)
    answer = client.get("/refuse/broken/", headers={"X-Request-ID": "from-the-proxy.1"})
    assert answer["X-Request-ID"] == "from-the-proxy.1"
    lines = log.getvalue().splitlines()
    assert len(lines) > 5, "a traceback"
    for line in lines:
        found = LINE.fullmatch(line)
        assert found and found[1] == str(os.getpid()) and found[2] == "from-the-proxy.1", line


@pytest.mark.django_db
@pytest.mark.parametrize("sent", ["", "a b", "a\nb", "x" * 65, "é", "<script>", "-", "a;b", '"'])
def test_an_unsafe_request_id_is_replaced(sent: str) -> None:
    answers = [Client().get("/about/", headers={"X-Request-ID": sent})["X-Request-ID"] for _ in range(2)]
    assert all(re.fullmatch(r"[0-9a-f]{32}", answer) for answer in answers) and len({*answers}) == 2


def test_a_message_cannot_forge_a_line(log: io.StringIO) -> None:
    logging.getLogger("config").warning("one\n2026-01-01T00:00:00.000Z web[1] - E x forged \x1b[31m\u202e\r\u2028")
    lines = log.getvalue().split("\n")
    assert all(LINE.fullmatch(line) for line in lines[:-1]) and lines[-1] == ""
    assert f"[{os.getpid()}]" in lines[1] and log.getvalue().isascii() and "\x1b" not in log.getvalue()


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (["/site/config/web.py", "--port", "1"], "web"),
        (["/site/config/streams.py"], "streams"),
        (["/lib/celery/__main__.py", "--app", "config", "worker", "--pool", "prefork"], "worker"),
        (["/bin/celery", "-A", "config", "worker", "-n", "video-worker@%h"], "video-worker"),
        (["/bin/celery", "-A", "config", "worker", "--hostname=trainer@%h"], "trainer"),
        (["/bin/celery", "--app", "config", "beat"], "beat"),
        (["manage.py", "--traceback", "migrate"], "migrate"),
        ([], "python"),
    ],
)
def test_a_program_is_named_as_run_names_it(arguments: list[str], name: str) -> None:
    assert program_of(tuple(arguments)) == name


def _down(*args: Any) -> None:
    raise OperationalError("server closed the connection unexpectedly\n\tThis probably means the server ended")


@pytest.mark.django_db
def test_an_outage_of_the_database_is_one_line(log: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> None:
    client = Client(raise_request_exception=False)
    client.force_login(a_racer("alice"), "django.contrib.auth.backends.ModelBackend")
    with connection.execute_wrapper(_down):
        for address in ("/", "/races/", "/api/v1/races/", "/api/v1/me/", "/about/", "/tracks/", "/racers/alice/") * 3:
            answer = client.get(address)
            assert answer.status_code == 503 and answer["Retry-After"], address
    assert log.getvalue().count("\n") == 1 and "Traceback" not in log.getvalue(), log.getvalue()
    assert "The database does not answer: server closed the connection" in log.getvalue()
    monkeypatch.setattr("core.logs.filters.QUIET_S", 0.0)
    with connection.execute_wrapper(_down):
        client.get("/")
    last = log.getvalue().splitlines()[-1]
    assert "more since the last line" in last, "an outage that lasts is told again"


def test_outages_of_broker_and_storage_are_one_line_each(log: io.StringIO) -> None:
    for _ in range(5):
        for error in (
            redis.ConnectionError("refused"),
            BrokerError("refused"),
            _storage_fault(PermissionError(13, "no")),
        ):
            logging.getLogger("celery.worker").error("Cannot go on:\n%s", "stack", exc_info=error, stack_info=True)
    assert log.getvalue().count("\n") == 2 and "Traceback" not in log.getvalue(), log.getvalue()


def test_mistakes_keep_their_traceback(log: io.StringIO) -> None:
    damaged = _storage_fault(EOFError("cut short"))
    for error in (damaged, _sqlite("select nothing_there"), ValueError("ours")):
        log.truncate(log.seek(0))
        logging.getLogger("config").error("Failed", exc_info=error)
        assert f"{type(error).__name__}" in log.getvalue() and log.getvalue().count("\n") > 1


def _storage_fault(cause: Exception) -> PlatformFault:
    fault = PlatformFault("storage_failed")
    fault.__cause__ = cause
    return fault


def _sqlite(query: str) -> Exception:
    with pytest.raises(sqlite3.OperationalError) as caught:
        sqlite3.connect(":memory:").execute(query)
    return caught.value


@pytest.mark.django_db
def test_the_log_has_neither_addresses_nor_links(log: io.StringIO, settings: Any, tmp_path: Path) -> None:
    """By default a newcomer's e-mail is a file; the log names the file."""
    settings.EMAIL_BACKEND, settings.EMAIL_FILE_PATH = FOLDER_BACKEND, tmp_path / "mail"
    password = "correct horse battery"
    form = {"username": "newcomer", "email": "newcomer@example.org", "password1": password, "password2": password}
    client = Client()
    assert client.post("/accounts/signup/", form).status_code == 302
    client.logout()
    client.post("/accounts/password/reset/", {"email": "newcomer@example.org"})
    files = list((tmp_path / "mail").iterdir())
    mails = "".join(file.read_text() for file in files)
    links = re.findall(r"http://\S+(/accounts/(?:confirm-email|password)/\S+)", mails)
    assert len(links) >= 2 and "newcomer@example.org" in mails
    assert all(str(file) in log.getvalue() for file in files)
    for link in links:
        client.get(link + "none")
        logging.getLogger("django.request").warning("Not Found: %s", link)
        assert link.split("/")[-2] not in log.getvalue()
    assert "@" not in log.getvalue().replace("…@…", "")


def test_a_full_folder_of_mails_keeps_the_newest(
    settings: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("core.mail.KEPT", 2)
    settings.EMAIL_BACKEND, settings.EMAIL_FILE_PATH = FOLDER_BACKEND, tmp_path
    for number in range(4):
        (tmp_path / f"20200101-00000{number}-1.log").write_text("old")
    send_mail("Hello", "text", None, ["ann@example.org"])
    assert len(list(tmp_path.iterdir())) == 2
    assert "ann@example.org" in max(tmp_path.iterdir()).read_text()


@pytest.mark.parametrize(
    "text",
    [
        "{'ann@example.org': (550, b'no such user <ann@example.org>')}",
        "postgres://paddock:SECRET-word@db/paddock",
        "smtp://user@example.org:SECRET-word@mail.example.org:587/?tls=True",
        "GET /x?token=SECRET-word&next=/",
        "GET /x?a=1&code=SECRET-word",
        "한글@example.org",
    ],
)
def test_secrets_in_messages_and_tracebacks_are_hidden(log: io.StringIO, text: str) -> None:
    logging.getLogger("league").error("Refused: %s", text, exc_info=ValueError(text))
    assert "ValueError" in log.getvalue()
    for secret in ("ann@", "SECRET", "한글", "user@example"):
        assert secret not in log.getvalue()


def test_workers_are_named_in_full(log: io.StringIO) -> None:
    logging.getLogger("evaluation").error("%s and %s", "trainer@box.local", "celery@box.local")
    assert "trainer@box.local and celery@box.local" in log.getvalue()


def test_every_address_with_a_secret_is_hidden(log: io.StringIO) -> None:
    secret, found = "Abc123-Abc123_Abc123", 0
    for pattern, names in _addresses(get_resolver().url_patterns):
        if names & SECRETS:
            found += 1
            at = re.sub(r"\(\?P<\w+>[^)]*\)", secret, pattern).replace("^", "").replace("$", "")
            at = re.sub(r"<(?:\w+:)?(\w+)>", lambda word: secret if word[1] in SECRETS else "open", at)
            logging.getLogger("django.request").warning("Not Found: %s", f"/{at}")
            assert secret not in log.getvalue(), at
    assert found >= 15


def _addresses(patterns: list[Any], before: str = "") -> Iterator[tuple[str, set[str]]]:
    for each in patterns:
        at = before + str(each.pattern)
        if isinstance(each, URLResolver):
            yield from _addresses(each.url_patterns, at)
        else:
            yield at, {*each.pattern.converters, *getattr(each.pattern, "regex", re.compile("")).groupindex}

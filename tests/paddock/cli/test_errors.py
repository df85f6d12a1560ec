"""What goes wrong between home and a site: each has a code, a sentence and an exit status, and nothing is sent on."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from paddock.cli.site import Site, SiteRefusal

ANSWERS: dict[str, tuple[int, dict[str, str], bytes]] = {
    "a page": (200, {"Content-Type": "text/html"}, b"<html>Welcome</html>"),
    "no API": (404, {"Content-Type": "text/html"}, b"<html>Not found</html>"),
    "JSON of somebody else": (403, {"Content-Type": "application/json"}, b'{"detail": "no"}'),
    "a list": (200, {"Content-Type": "application/json"}, b"[1, 2]"),
    "another API": (200, {"Content-Type": "application/json"}, b'{"items": []}'),
    "half a Paddock": (200, {"Content-Type": "application/json"}, b'{"results": [{"slug": "a"}], "pages": 1}'),
    "a painter": (
        200,
        {"Content-Type": "application/json"},
        json.dumps(
            {
                "results": [
                    {
                        "slug": "red",
                        "state": "open",
                        "track": {"slug": "oval"},
                        "race_type": "time_trial",
                        "closes_at": "2026-12-01T00:00:00Z",
                        "name": "\x1b[31mRed\x1b]0;mine\x07",
                    }
                ],
                "pages": 1,
            }
        ).encode(),
    ),
    "broken": (502, {"Content-Type": "text/html"}, b"<html>Bad gateway</html>"),
    "moved": (301, {"Location": "https://elsewhere.example.org/"}, b""),
    "refuses": (
        429,
        {"Content-Type": "application/json", "Retry-After": "30"},
        json.dumps(
            {"code": "throttled", "message": "Too often. Try again in 30 s.", "fault": "user", "params": {"wait_s": 30}}
        ).encode(),
    ),
    "is busy": (
        503,
        {"Content-Type": "application/json"},
        json.dumps({"code": "upload_busy", "message": "Try again.", "fault": "platform", "params": {}}).encode(),
    ),
    "forges": (
        503,
        {"Content-Type": "application/json"},
        json.dumps({"code": "no", "message": "No.\nforged: line", "fault": "user", "params": None}).encode(),
    ),
    "no token": (
        401,
        {"Content-Type": "application/json"},
        json.dumps({"code": "not_authenticated", "message": "…", "fault": "user", "params": {}}).encode(),
    ),
}


class Stranger(BaseHTTPRequestHandler):
    """Answers everything as it is told to."""

    says = "a page"
    heard: list[tuple[str, str]] = []

    def do_GET(self) -> None:
        status, headers, body = ANSWERS[self.says]
        self.heard.append((self.path, self.headers.get("Authorization", "")))
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Nothing."""


@pytest.fixture(scope="module")
def stranger() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Stranger)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize(
    ("says", "code", "status"),
    [
        ("a page", "site_is_no_paddock", 2),
        ("no API", "site_is_no_paddock", 2),
        ("JSON of somebody else", "site_is_no_paddock", 2),
        ("a list", "site_is_no_paddock", 2),
        ("another API", "site_is_no_paddock", 2),
        ("half a Paddock", "site_is_no_paddock", 2),
        ("broken", "site_broken", 3),
        ("moved", "site_elsewhere", 2),
        ("refuses", "throttled", 2),
        ("is busy", "upload_busy", 3),
        ("forges", "no", 2),
        ("no token", "token_missing", 2),
    ],
)
def test_whatever_answers_is_told_with_a_code(paddock, stranger, monkeypatch, says, code, status):
    monkeypatch.setattr(Stranger, "says", says)
    said = paddock("races", "--site", stranger)
    assert (said.code, said.status, said.out) == (code, status, "")
    told = paddock("races", "--site", stranger, "--json")
    assert told.json["error"]["code"] == code and told.json["error"]["message"]


def test_a_site_does_not_paint_on_the_terminal(paddock, stranger, monkeypatch):
    monkeypatch.setattr(Stranger, "says", "a painter")
    said = paddock("races", "--site", stranger)
    assert said.status == 0 and "?[31mRed?]0;mine?" in said.out and "\x1b" not in said.out
    told = paddock("races", "--site", stranger, "--json")
    assert "\x1b" not in told.out and told.json[0]["name"].startswith("\x1b")


def test_a_refused_token_is_told_apart_from_none(paddock, stranger, monkeypatch):
    monkeypatch.setattr(Stranger, "says", "no token")
    monkeypatch.setenv("PADDOCK_SITE", stranger)
    monkeypatch.setenv("PADDOCK_TOKEN", "secret")
    assert paddock("races").code == "token_refused"


def test_a_token_does_not_follow_to_another_site(paddock, stranger, monkeypatch):
    monkeypatch.setattr(Stranger, "says", "moved")
    monkeypatch.setattr(Stranger, "heard", [])
    monkeypatch.setenv("PADDOCK_SITE", "https://race.example.org")
    monkeypatch.setenv("PADDOCK_TOKEN", "secret")
    assert paddock("board", f"{stranger}/races/open/").code == "site_elsewhere"
    assert Stranger.heard == [("/api/v1/races/open/board/?page=1", "")]


def test_no_network_is_said(paddock):
    said = paddock("races", "--site", "http://127.0.0.1:9")
    assert (said.code, said.status) == ("site_unreachable", 3)


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["races"], "site_missing"),
        (["races", "--site", "race.example.org"], "site_address"),
        ([], "home_command_line"),
        (["drive"], "home_command_line"),
        (["evaluate", "car.zip"], "home_command_line"),
        (["evaluate", "a", "b", "c", "--track", "oval"], "home_command_line"),
        (["evaluate", "car.zip", "--track", "ovla"], "track_unknown"),
        (["evaluate", "car.zip", "--track", "ours.npy"], "home_file_unreadable"),
        (["evaluate", "car.zip", "--track", "oval", "--rule", "laps"], "rule_senseless"),
        (["evaluate", "car.zip", "--track", "oval", "--rule", "laps=0"], "rule_senseless"),
        (["evaluate", "car.zip", "--track", "oval", "--rule", "boxes=[1]"], "rule_senseless"),
        (["evaluate", "car.zip", "--track", "oval", "--rule", "wings=2"], "rule_senseless"),
        (["evaluate", "car.zip", "--race", "open", "--rule", "laps=1"], "home_command_line"),
        (["board", "https://race.example.org/tracks/oval/"], "race_wanted"),
        (["verify", "https://race.example.org/races/open/"], "result_wanted"),
        (["upload", "nothing.zip", "--site", "http://127.0.0.1:9"], "home_file_unreadable"),
    ],
)
def test_what_cannot_be_asked_is_refused_before_anything_is_sent(paddock, arguments, code):
    said = paddock(*arguments)
    assert (said.code, said.status) == (code, 2)


class Recovers(BaseHTTPRequestHandler):
    """Gives the answers of ``script`` in turn: a status and a code each; after the last one, a model."""

    script: list[tuple[int, str, float]] = []
    keys: list[str] = []

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        self.keys.append(self.headers.get("Idempotency-Key", ""))
        status, code, wait_s = self.script.pop(0) if self.script else (201, "", 0)
        body = {"code": code, "message": code, "fault": "platform", "params": {"wait_s": wait_s}}
        data = json.dumps(body if code else {"public_id": "abcdefghijkl"}).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        """Nothing."""


@pytest.fixture
def recovering(monkeypatch) -> Iterator[str]:
    monkeypatch.setattr(Recovers, "keys", [])
    server = ThreadingHTTPServer(("127.0.0.1", 0), Recovers)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize(
    ("script", "tries"),
    [
        ([(503, "unavailable", 0)], 2),
        ([(502, "", 0), (409, "idempotency_key_in_use", 0)], 3),
        ([(429, "throttled", 0)], 2),
    ],
)
def test_a_creating_request_is_repeated_with_the_same_key(recovering, monkeypatch, script, tries):
    monkeypatch.setattr(Recovers, "script", list(script))
    assert Site(recovering).post("/evaluations/")["public_id"] == "abcdefghijkl"
    assert len(Recovers.keys) == tries and len(set(Recovers.keys)) == 1 and Recovers.keys[0]


@pytest.mark.parametrize(
    ("status", "code", "wait_s"), [(409, "race_closed", 0), (429, "throttled", 3000), (400, "x", 0)]
)
def test_a_final_refusal_is_not_repeated(recovering, monkeypatch, status, code, wait_s):
    monkeypatch.setattr(Recovers, "script", [(status, code, wait_s)])
    with pytest.raises(SiteRefusal):
        Site(recovering).post("/evaluations/")
    assert len(Recovers.keys) == 1


def test_two_requests_have_two_keys(recovering):
    Site(recovering).post("/evaluations/")
    Site(recovering).post("/evaluations/")
    assert len(set(Recovers.keys)) == 2


def test_a_site_that_stays_away_is_tried_a_few_times(recovering, monkeypatch):
    monkeypatch.setattr(Recovers, "script", [(503, "unavailable", 0)] * 9)
    with pytest.raises(SiteRefusal):
        Site(recovering).post("/evaluations/")
    assert len(Recovers.keys) == 3

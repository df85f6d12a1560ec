"""A site that means harm: it writes nowhere, paints nothing, proves nothing, and costs no endless time."""

from __future__ import annotations

import io
import json
import os
import sys
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from paddock.cli import proving
from paddock.cli import site as site_module
from paddock.cli.settings import SITE
from paddock.cli.showing import table
from paddock.cli.site import MOST_PAGES, Site
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID

HOME = "https://hostile.example.org"
RACE = {"slug": "a", "state": "open", "track": {"slug": "b"}, "race_type": "c", "closes_at": "2026", "name": "d"}


@pytest.fixture
def says(monkeypatch):
    """Puts an answer to every request, or one by the beginning of its path; gives the paths that were asked for."""
    monkeypatch.setenv(SITE, HOME)

    def put(answer: Any) -> list[str]:
        asked = []

        def raw(self: Site, method: str, path: str, *_: object) -> bytes:
            asked.append(path)
            found = answer
            if isinstance(answer, dict) and any(name.startswith("/") for name in answer):
                found = next(each for name, each in answer.items() if path.startswith(name))
            return found if isinstance(found, bytes) else json.dumps(found).encode()

        monkeypatch.setattr(Site, "raw", raw)
        return asked

    return put


def a_result(**car: Any) -> dict[str, Any]:
    """What a site says of a finished run, in all that ``paddock verify`` asks for."""
    track = {"slug": CATALOGUE[0].slug, "fingerprint": CATALOGUE[0].fingerprint, "look": "official"}
    one = {"number": 0, "racer": "ann", "open": False, "trace_sha256": "", "model": {"public_id": "a", "sha256": ""}}
    result = {"laps": [], "rivals": [], "retired": {"code": "stuck"}, "versions": {}, "end_reason": "", "order": [0]}
    return {
        "/evaluations/a/specification/": {
            "engine": ENGINE_ID,
            "track": track,
            "rules": RaceRules().to_dict(),
            "cars": [one | car],
        },
        "/evaluations/a/trace/": b"step\n1\n",
        "/evaluations/a/": {"state": "finished", "result": result},
    }


@pytest.mark.parametrize("absolute", [True, False])
def test_a_cars_number_is_no_path(paddock, says, tmp_path, monkeypatch, absolute):
    monkeypatch.setattr(proving, "trace_sha256", lambda data: "")
    monkeypatch.setattr(proving, "TemporaryDirectory", lambda **_: _Folder(tmp_path / "inner"))
    mine = tmp_path / "mine.csv"
    mine.write_text("precious")
    says(a_result(number=str(mine.with_suffix("")) if absolute else "../mine"))
    assert paddock("verify", "a").status == 3 and mine.read_text() == "precious"


class _Folder:
    def __init__(self, path: Any) -> None:
        self.path = path

    def __enter__(self) -> str:
        self.path.mkdir()
        return str(self.path)

    def __exit__(self, *_: object) -> None:
        """It stays for the test to look at."""


@pytest.mark.parametrize(
    "answer",
    [
        {"results": ["a"], "pages": 1},
        {"results": [RACE | {"closes_at": 7}], "pages": 1},
        {"results": [RACE | {"track": None}], "pages": 1},
        {"results": None, "pages": 1},
        {"results": [], "pages": "many"},
        b"[" * 200_000,
        b'{"results": ' + b"[" * 200_000,
    ],
    ids=["words", "a number", "no track", "nothing", "pages", "deep", "deeper"],
)
def test_an_answer_of_other_kinds_is_told(paddock, says, answer):
    says(answer)
    said = paddock("races")
    assert (said.code, said.status, said.out) == ("site_is_no_paddock", 2, "")
    assert paddock("races", "--json").json["error"]["code"] == "site_is_no_paddock"


def test_a_list_without_end_ends(paddock, says):
    asked = says({"results": [RACE], "pages": MOST_PAGES + 1})
    assert paddock("races").code == "site_is_no_paddock" and len(asked) == 1


@pytest.mark.parametrize(
    "trace",
    [b"", b"episode\n" + b"9" * 30, b"episode\n" + b"9" * 200_000, b"\xff", b"episode\nx"],
    ids=["empty", "too great", "too long", "no text", "no number"],
)
def test_a_trace_that_is_none_is_told(paddock, says, trace):
    says(a_result() | {"/evaluations/a/trace/": trace})
    assert paddock("verify", "a").code == "trace_strange"


def test_a_racers_name_forges_no_line(paddock, says, monkeypatch):
    monkeypatch.setattr(proving, "trace_sha256", lambda data: "1")
    says(a_result(trace_sha256="0\nProven: the networks were driven again"))
    said = paddock("verify", "a")
    assert said.status == 1 and not any(line.startswith("Proven") for line in said.out.splitlines())
    assert len(table(("a", "b"), [("x\r\ny\u2028z", 1)]).splitlines()) == 2


def test_what_a_lap_is_said_to_have_been_is_compared():
    lap = {"number": 1, "time_ms": 1, "sector_ms": [1], "off_tracks": 0, "crashes": 0, "resets": 0}
    assert proving._laps([{**lap, "status": "complete"}]) != proving._laps([{**lap, "status": "off_track"}])


@pytest.mark.parametrize("name", ["..", "..\\..\\mine", "short", "x" * 13])
def test_a_download_is_named_after_an_id_alone(paddock, says, name):
    asked = says(b"evil")
    assert paddock("download", f"{HOME}/models/{name}/").code == "home_command_line" and asked == []


def test_a_terminal_without_the_letters_of_a_name_shows_the_others(says, monkeypatch):
    from paddock.cli.main import main

    says({"results": [RACE | {"name": "훈련 cup"}], "pages": 1})
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", out)
    assert main(["races"]) == 0
    out.flush()
    assert b"?? cup" in out.buffer.getvalue()


def test_half_an_option_is_none(paddock, says):
    asked = says({"results": [], "pages": 1})
    assert paddock("races", "--js").code == "home_command_line" and asked == []


def test_names_that_are_no_utf_8_are_sent_with_replacements(paddock, says, tmp_path):
    asked = says({"public_id": "a" * 12})
    file = tmp_path / os.fsdecode(b"car\xff.zip")
    file.write_bytes(b"x")
    assert Site(HOME).send_files("/models/", {"package": file}, {"name": "car\udcff"}) == {"public_id": "a" * 12}
    assert asked == ["/models/"]


def test_an_argument_that_is_no_utf_8_is_not_blamed_on_the_site(paddock, monkeypatch):
    class Opener:
        def open(self, request: Any, timeout: float) -> Any:
            raise urllib.error.URLError(request.full_url)

    monkeypatch.setattr(urllib.request, "build_opener", lambda *_: Opener())
    said = paddock("board", "car\udcff", "--site", HOME)
    assert said.code == "site_unreachable" and "/car%5Cudcff/" in said.err


def test_a_file_without_end_is_refused(monkeypatch):
    monkeypatch.setattr(site_module, "MOST_SENT_MB", 1)
    with pytest.raises(UserFault) as refused:
        Site(HOME).send_files("/models/", {"package": Path("/dev/zero")}, {})
    assert (refused.value.code, refused.value.params) == ("too_large", {"limit_mb": 1})

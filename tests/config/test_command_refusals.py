"""Every command with --json tells what it refuses as JSON with a code, and exits with the documented status."""

from __future__ import annotations

import io
import json
import subprocess
import sys

import pytest
from django.conf import settings
from django.core.management import call_command, execute_from_command_line

from core.management.base import REFUSED, Refusal
from paddock.errors.reasons import REASONS

EVALUATE = ("evaluate", "car.zip", "--track")
REFUSED_LINES = {
    "track_not_found": (*EVALUATE, "nowhere"),
    "file_unreadable": (*EVALUATE, "oval"),
    "rules_senseless": (*EVALUATE, "oval", "--laps", "0"),
    "file_unreadable (track)": (*EVALUATE, "missing.npy"),
    "track_not_found (replay)": ("replay_trace", "trace.csv", "--track", "nowhere"),
    "file_unreadable (replay)": ("replay_trace", "trace.csv", "--track", "oval"),
    "file_unreadable (import)": ("import_track", "missing.npy"),
}


@pytest.mark.django_db  # a track that is none is looked for among the site's own
@pytest.mark.parametrize("case", REFUSED_LINES)
def test_a_refusal_is_printed_as_json_with_a_code(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = io.StringIO()
    with pytest.raises(Refusal) as refusal:
        call_command(*REFUSED_LINES[case], "--json", stdout=out, stderr=io.StringIO())
    error = json.loads(out.getvalue())["error"]
    assert error["code"] == case.split(" ")[0]
    assert error["code"] in REASONS and error["message"] in str(refusal.value)
    assert refusal.value.returncode == REFUSED


@pytest.mark.django_db
def test_invalid_tracks_and_seasons_are_reported_as_json(tmp_path):
    (tmp_path / "bad.npy").write_bytes(b"not a track")
    for line in (("import_track", str(tmp_path / "bad.npy")), ("import_season", str(tmp_path))):
        out = io.StringIO()
        with pytest.raises(Refusal) as refusal:
            call_command(*line, "--json", stdout=out)
        error = json.loads(out.getvalue())["error"]
        assert error["code"] in REASONS and str(refusal.value).startswith(f"{error['code']}: ")
        assert refusal.value.returncode == REFUSED


def test_without_json_only_the_sentence_is_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = io.StringIO()
    with pytest.raises(Refusal, match=r"^file_unreadable: car\.zip cannot be read: No such file"):
        call_command(*EVALUATE, "oval", stdout=out)
    assert out.getvalue() == ""


@pytest.mark.parametrize("command", ["evaluate", "replay_trace", "import_track", "import_season", "doctor"])
def test_an_unknown_option_is_reported_as_json(command, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["manage.py", command, "--json", "--no-such-option"])
    with pytest.raises(SystemExit) as ended:
        execute_from_command_line(sys.argv)
    told = capsys.readouterr()
    _check_told(ended.value.code, told.out, told.err)


@pytest.mark.slow
def test_a_separate_process_prints_and_exits_the_same(tmp_path):
    ran = subprocess.run(
        [sys.executable, "manage.py", "evaluate", "--json", "--no-such-option"],
        cwd=settings.BASE_DIR,
        env={"PADDOCK_DATA": str(tmp_path), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    _check_told(ran.returncode, ran.stdout, ran.stderr)


def _check_told(status: int, out: str, err: str) -> None:
    assert status == REFUSED
    error = json.loads(out)["error"]
    assert error["code"] == "command_line"
    assert error["params"]["problem"] in error["message"]
    assert "usage: " in err

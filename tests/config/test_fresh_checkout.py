"""Every command, before there is a database, with an empty one, and without what it asks for: a sentence, no
traceback, and an exit status that says so."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Timer

import numpy as np
import pytest
from django.core.management import execute_from_command_line

from paddock.geometry.catalogue import by_slug
from tests.shared import CHECKOUT

COMMANDS = sorted(path.stem for path in CHECKOUT.glob("*/management/commands/[a-z]*.py") if path.parts[-4] != "core")
# of each command: what it is given, so that it comes to its database or its file
GIVEN = {
    "audit": [],
    "backup": ["new.backup"],
    "delete_account": ["alice"],
    "restore": ["nothing.backup"],
    "evaluate": ["nothing.tar.gz", "--track", "oval"],
    "export_season": ["2026", "out"],
    "forget_second_factor": ["alice"],
    "import_season": ["season"],
    "import_track": ["track.npy"],
    "replay_trace": ["nothing.csv", "--track", "a-track-of-ours"],
    "report": ["nothing.tar.gz"],
    "verify": ["abcdefghijkl"],
    "workers": [],
}
NEED_NONE = ("audit", "delete_account", "workers")
ASKS = ("doctor", "run", "setup", "units")  # report what they find, make what is missing, or ask no database
Run = Callable[..., subprocess.CompletedProcess]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with files that are good, and a data folder that nothing was ever put into."""
    made = tmp_path_factory.mktemp("fresh")
    geometry = by_slug("oval").geometry()
    np.save(made / "track.npy", np.hstack([geometry.centre, geometry.inner, geometry.outer]))
    (made / "season").mkdir()
    return made


class Commands:
    """A process that does commands in an environment, one after the other (tests/config/commands.py)."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        keep = {name: os.environ[name] for name in ("PATH", "HOME", "LANG") if name in os.environ}
        self._folder = folder
        self._process = subprocess.Popen(
            [sys.executable, CHECKOUT / "tests/config/commands.py"],
            cwd=folder,
            env={**keep, "PADDOCK_DATA": str(folder / "data"), "OMP_NUM_THREADS": "1", **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, arguments: Sequence[str]) -> subprocess.CompletedProcess:
        with TemporaryDirectory() as kept:
            out, err = Path(kept, "out"), Path(kept, "err")
            late = Timer(120, self._process.kill)
            late.start()
            print(json.dumps([arguments, str(out), str(err)]), file=self._process.stdin, flush=True)
            status = self._process.stdout.readline()
            late.cancel()
            assert status, f"{arguments}: no end within two minutes, or the process does not begin"
            return subprocess.CompletedProcess(arguments, int(status), out.read_text(), err.read_text())

    def close(self) -> None:
        with self._process:
            self._process.kill()


@pytest.fixture(scope="module")
def run(folder) -> Iterator[Run]:
    """Do a command in an environment; the site is loaded once for all commands in the same one."""
    with ExitStack() as ending:

        @cache
        def commands_in(*environment: tuple[str, str]) -> Commands:
            commands = Commands(folder, dict(environment))
            ending.callback(commands.close)
            return commands

        yield lambda *arguments, **environment: commands_in(*environment.items()).run(arguments)


def said(done: subprocess.CompletedProcess) -> str:
    """The one sentence of a command that could not do what it was asked."""
    assert done.returncode != 0, done.stdout
    assert "Traceback" not in done.stderr, done.stderr[-2000:]
    lines = [line for line in done.stderr.splitlines() if "pybullet build time" not in line]
    assert len(lines) == 1, done.stderr[-2000:]
    return lines[0]


def test_every_command_is_tested():
    assert set(COMMANDS) == {*GIVEN, *ASKS}


@pytest.mark.slow
@pytest.mark.parametrize("command", GIVEN)
def test_every_command_explains_a_missing_database(run, command):
    sentence = said(run(command, *GIVEN[command]))
    assert "database_not_ready" in sentence or "cannot be " in sentence or "import_no_folder" in sentence
    asking = (*NEED_NONE, "backup", "export_season", "forget_second_factor", "import_track", "verify")
    assert ("database_not_ready" in sentence) == (command in asking)


@pytest.mark.slow
@pytest.mark.parametrize(
    "database",
    ["postgres://127.0.0.1:1/none", "sqlite:////nowhere/at/all.sqlite3", f"sqlite:///{__file__}"],
    ids=["no server", "no folder", "another file"],
)
def test_an_unreachable_database_is_explained(run, database):
    assert "database_not_ready: " in said(run("verify", "abcdefghijkl", DATABASE_URL=database))


@pytest.mark.slow
def test_djangos_own_commands_explain_it_too(run):
    assert "database_not_ready: " in said(run("clearsessions"))


def test_with_json_the_explanation_is_on_standard_output(run):
    done = run("import_track", "track.npy", "--json")
    assert said(done)
    error = json.loads(done.stdout)["error"]
    assert (error["code"], error["fault"]) == ("database_not_ready", "platform")


@pytest.mark.slow
def test_a_traceback_is_printed_on_request(run):
    assert "Traceback" in run("verify", "abcdefghijkl", "--traceback").stderr


@pytest.mark.parametrize("command", [command for command in GIVEN if command not in NEED_NONE])
def test_missing_arguments_are_named(command, capsys):
    with pytest.raises(SystemExit) as ended:
        execute_from_command_line(["manage.py", command])
    assert ended.value.code == 2
    assert "the following arguments are required" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.slow
def test_commands_work_on_an_empty_database(run, folder, new_data):
    database = f"sqlite:///{new_data(folder / 'empty') / 'paddock.sqlite3'}"
    assert run("migrate", "--verbosity", "0", DATABASE_URL=database).returncode == 0
    for command, sentence in {
        "verify": "There is no evaluation abcdefghijkl.",
        "export_season": "2026",
        "import_season": "import_no_folder",
        "replay_trace": "a-track-of-ours",
        "evaluate": "file_unreadable",
    }.items():
        assert sentence in said(run(command, *GIVEN[command], DATABASE_URL=database)), command

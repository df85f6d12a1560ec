"""The units of systemd: rendered from the programs of ``manage.py run``, clean by systemd's tools, all or none."""

from __future__ import annotations

import os
import pwd
import re
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest
from django.core.management import call_command

from config.operations.run import in_fewer_processes, programs
from config.operations.units import installing, texts
from config.operations.units.rendering import render_units, unit_name
from core.management.base import Refusal
from paddock.errors import UserFault
from tests.shared import CHECKOUT

ANALYZE = shutil.which("systemd-analyze")
needs_systemd = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is missing (Debian: systemd)")
PLAIN_EXPOSURE, SANDBOX_EXPOSURE = 15, 30  # tenths: systemd calls up to 40 OK, and a unit without settings has 96
BROKEN_BY = {
    "RestrictNamespaces": "yes",
    "ProcSubset": "pid",
    "RestrictAddressFamilies": "AF_UNIX AF_INET AF_INET6",
    "SystemCallFilter": "@system-service",
}
PROBE = "from evaluation.sandbox.probe import look_again as look; r = look(); print('level', r.level); print(r.table())"


@pytest.fixture(autouse=True)
def somewhere(settings):
    settings.TRAINING = settings.VIDEOS = settings.EMBEDDED_BROKER = True
    settings.DATA_DIR, settings.METRICS_LISTEN = Path("/srv/paddock"), ("127.0.0.1", 9464)
    settings.VALKEY_DIR = settings.DATA_DIR / "valkey"
    settings.VALKEY_SOCKET = settings.VALKEY_DIR / "valkey.sock"
    settings.STREAM_SOCKET = settings.DATA_DIR / "streams/streams.sock"


def commands() -> dict[str, list[str]]:
    return in_fewer_processes(programs("127.0.0.1", 8000))


def rendered(**changes) -> dict[str, str]:
    values = {"user": "games", "env_file": Path("/etc/paddock.env"), **changes}  # a user that every Debian has
    return render_units(values.pop("commands", commands()), **values)


def written(folder: Path, units: dict[str, str]) -> list[Path]:
    for name, text in units.items():
        (folder / name).write_text(text)
    return [folder / name for name in units]


def refusal(**changes) -> str:
    with pytest.raises(UserFault) as raised:
        rendered(**changes)
    assert raised.value.code == "units_refused"
    return str(raised.value)


def test_every_program_of_run_has_a_unit_with_its_command():
    units = rendered()
    assert set(units) == {*map(unit_name, commands()), "paddock.target"}
    assert set(texts.NEEDS) == set(commands())
    for name, command in commands().items():
        (line,) = re.findall(r"^ExecStart=(.*)$", units[unit_name(name)], flags=re.M)
        words = [word.strip('"') for word in line.replace("%%", "%").split(" ")]
        assert words == " ".join(command).split(" ")
        assert unit_name(name) in units["paddock.target"]


def test_a_program_without_needs_is_an_error():
    with pytest.raises(KeyError):
        rendered(commands={"new": ["/bin/true"]})


def test_programs_start_after_the_broker_only_where_there_is_one(settings):
    assert "paddock-broker" in rendered()["paddock-web.service"]
    settings.EMBEDDED_BROKER = False
    assert "paddock-broker" not in "".join(rendered().values())


@needs_systemd
@pytest.mark.slow
def test_systemd_finds_no_fault_in_the_units(tmp_path):
    files = written(tmp_path, rendered(backups=Path("/var/backups/paddock")))
    found = subprocess.run(
        [ANALYZE, "verify", "--man=no", *files],
        capture_output=True,
        text=True,
        env={**os.environ, "SYSTEMD_UNIT_PATH": f"{tmp_path}:"},
    )
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")


@needs_systemd
@pytest.mark.slow
def test_each_unit_stays_below_its_bound_of_exposure(tmp_path):
    for file in written(tmp_path, rendered(backups=Path("/var/backups/paddock"))):
        if file.suffix != ".service":
            continue
        needs = texts.NEEDS.get(file.stem.removeprefix("paddock-"))
        bound = SANDBOX_EXPOSURE if needs and needs.sandbox else PLAIN_EXPOSURE
        command = [ANALYZE, "security", "--offline=true", "--no-pager", f"--threshold={bound}", file]
        found = subprocess.run(command, capture_output=True, text=True)
        assert (found.returncode, found.stderr) == (0, ""), found.stdout[-200:]


def confined(unit: str, folder: Path) -> int:
    """The level of the sandbox under the settings of a unit."""
    if os.geteuid() != 0 or ANALYZE is None or shutil.which("bwrap") is None:
        pytest.skip("needs root, bubblewrap and systemd-analyze")
    (folder / "unit").write_text(unit.replace("/srv/paddock", str(folder)))
    command = [sys.executable, "-m", "tests.config.confined", folder / "unit", sys.executable, "-c", PROBE]
    ended = subprocess.run(
        command, cwd=CHECKOUT, capture_output=True, text=True, env={**os.environ, "PADDOCK_DATA": str(folder)}
    )
    assert ended.returncode == 0, ended.stderr
    return int(ended.stdout.split()[1])


@pytest.mark.slow
@pytest.mark.parametrize("program", [name for name, needs in texts.NEEDS.items() if needs.sandbox])
def test_the_sandbox_is_whole_under_a_unit(program, tmp_path):
    assert confined(rendered()[unit_name(program)], tmp_path) == 3


@pytest.mark.slow
@pytest.mark.parametrize("name", BROKEN_BY)
def test_a_setting_that_is_left_out_would_break_the_sandbox(name, tmp_path):
    unit = rendered()["paddock-worker.service"]
    assert f"#   {name}" in unit
    lines = [line for line in unit.splitlines() if not line.startswith(f"{name}=")]
    assert confined("\n".join([*lines, f"{name}={BROKEN_BY[name]}"]), tmp_path) < 3


@pytest.mark.soak
def test_a_booted_systemd_runs_the_units_as_the_guide_says(tmp_path):
    missing = [program for program in ("debootstrap", "systemd-nspawn") if not shutil.which(program)]
    if missing or os.geteuid():
        pytest.skip(f"needs root and Debian's packages debootstrap and systemd-container; missing: {missing}")
    command = [CHECKOUT / "scripts/try_units.sh", "--place", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-5000:]
    for program in ("celery", "trainer"):
        assert f"{program}@{os.uname().nodename} sandbox 3 golden runs 3 of 3" in done.stdout


@pytest.mark.parametrize("user", ["root", "", "two words", "new\nline", "-option", "a" * 40, "Ä"])
def test_a_bad_user_is_refused(user):
    assert "user" in refusal(user=user)


def test_a_path_that_systemd_would_misread_is_refused(settings):
    for path in ("/etc/two words", "relative", "/etc/%h", '/etc/"'):
        assert path in refusal(env_file=Path(path))
    settings.DATA_DIR = Path("/tmp/paddock")
    assert "temporary" in refusal()


def test_homes_are_hidden_unless_something_of_ours_is_there(settings, monkeypatch):
    monkeypatch.setattr("config.operations.units.rendering.PYTHON", ["/usr/bin/python3", "-m"])
    settings.BASE_DIR = Path("/opt/paddock")
    assert "ProtectHome=yes" in rendered()["paddock-web.service"]
    settings.BASE_DIR = Path("/home/alice/paddock")
    assert "ProtectHome=read-only" in rendered()["paddock-web.service"]


def command(*arguments: str) -> str:
    out = StringIO()
    call_command("units", *arguments, stdout=out)
    return out.getvalue()


def test_print_shows_the_units_and_writes_nothing(tmp_path):
    shown = command("web", "worker", "--print", "--directory", str(tmp_path), "--port", "9000")
    assert f"# {tmp_path}/paddock-web.service" in shown and "--port 9000" in shown
    assert "Wants=paddock-web.service paddock-worker.service\n" in shown
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def place(tmp_path, settings, monkeypatch):
    """A set of units, and where they may be installed."""
    units_of_site = rendered()
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    mine = pwd.getpwuid(os.getuid())
    data, units, env_file = (tmp_path / name for name in ("data", "units", "env"))
    data.mkdir()
    units.mkdir()
    env_file.write_text("# settings\nPADDOCK_SITE_URL='https://race.example.org'\n")
    monkeypatch.setenv("PADDOCK_SITE_URL", "https://race.example.org")
    monkeypatch.setattr("config.operations.units.installing.settings.DATA_DIR", data)
    monkeypatch.setattr(pwd, "getpwnam", lambda name: mine)
    return units, env_file, units_of_site


def install(place) -> list[str]:
    directory, env_file, units = place
    return installing.install_units(units=units, user="games", directory=directory, env_file=env_file)


def test_the_units_are_written_and_old_ones_of_ours_deleted(place):
    units, _, texts_of_units = place
    (units / "paddock-beat.service").write_text(texts.HEADER + "\n[Unit]\n")
    (units / "paddock-own.service").write_text("[Unit]\nDescription=the operator's\n")
    assert install(place) == ["paddock-beat.service"]
    assert {path.name for path in units.iterdir()} == {*texts_of_units, "paddock-own.service"}
    assert {path.stat().st_mode & 0o777 for path in units.glob("paddock.*")} == {0o644}


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda patch, units, env: patch.setattr(os, "geteuid", lambda: 1000), "root"),
        (lambda patch, units, env: patch.setenv("PADDOCK_SITE_URL", "http://other"), "load that file first"),
        (lambda patch, units, env: env.unlink(), "No such file"),
        (lambda patch, units, env: units.rename(units.with_name("gone")), "No such file"),
    ],
    ids=["not root", "other settings", "no settings", "no directory"],
)
def test_a_refusal_changes_nothing(place, monkeypatch, spoil, why):
    units, env_file, _ = place
    before = sorted(units.iterdir())
    spoil(monkeypatch, units, env_file)
    with pytest.raises(UserFault, match=why):
        install(place)
    assert not units.exists() or sorted(units.iterdir()) == before


def test_a_user_that_there_is_not_is_refused(place, monkeypatch):
    def unknown(name: str):
        raise KeyError(name)

    monkeypatch.setattr(pwd, "getpwnam", unknown)
    with pytest.raises(UserFault, match="there is no user games"):
        install(place)


def test_the_command_refuses_with_a_sentence_and_a_status():
    with pytest.raises(Refusal, match="there is no program nothing here") as refused:
        command("nothing")
    assert refused.value.returncode == 2

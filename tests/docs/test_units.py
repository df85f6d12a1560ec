"""The units of systemd and the commands of "Several machines" exist, and are those that ``manage.py run`` starts."""

from __future__ import annotations

import re
import shlex
from configparser import ConfigParser
from functools import cache
from pathlib import Path

import pytest
from celery.bin.celery import celery as celery_cli
from django.conf import settings
from django.core.management import get_commands, load_command_class

from config.celery import app
from config.operations.run import in_fewer_processes, programs
from config.serving.forking import PYTHON

from .pages import CHECKOUT, code_blocks, section, text

UNITS = sorted((CHECKOUT / "docs/examples/systemd").glob("*.service"))
PAGE = section(text("operators.md"), "## Several machines")
TABLE = dict(re.findall(r"^\| `paddock-([a-z-]+)` \| .* \| `(.+)` \|$", PAGE, flags=re.M))
PLACE = "/opt/paddock/"


@cache
def unit(path: Path) -> ConfigParser:
    read = ConfigParser(interpolation=None, strict=True)
    read.optionxform = str
    read.read(path)
    return read


def name_of(path: Path) -> str:
    return path.stem.removeprefix("paddock-")


def started(path: Path) -> list[str]:
    """The command of a unit, as systemd reads it."""
    command = unit(path)["Service"]["ExecStart"]
    assert not re.search(r"(?<!%)%(?!%)", command.replace("%%", "")), "systemd reads a single %"
    return shlex.split(command.replace("%%", "%").removeprefix(PLACE))


def without_number(command: list[str]) -> list[str]:
    """Without what each machine chooses: how many at a time, and where the web server listens."""
    text = " ".join(command).replace("--quiet ", "").replace(" --hostname worker@%h", "")
    return re.sub(r" --(concurrency|host|port) \S+", "", text).split()


def test_run_starts_the_same_programs(settings):
    settings.TRAINING = settings.VIDEOS = True
    run = programs("127.0.0.1", 8000)
    run.pop("broker", None)
    assert {name_of(path) for path in UNITS} == set(run) == set(TABLE)
    for path in UNITS:
        ours = " ".join(started(path)).removeprefix(".venv/bin/").removeprefix("python -m ").split()
        assert without_number(ours) == without_number(run[name_of(path)][len(PYTHON) :]), path.name


def test_run_needs_no_process_for_the_scheduler():
    commands = programs("127.0.0.1", 8000)
    fewer = in_fewer_processes(commands)
    assert set(commands) - set(fewer) == {"beat"}
    assert fewer["messenger"] == [*commands["messenger"], "--with-scheduler"]


@pytest.mark.parametrize("path", UNITS, ids=name_of)
def test_a_unit_is_as_the_page_describes_it(path):
    service = unit(path)["Service"]
    nice = f"nice -n {service['Nice']} " if "Nice" in service else ""
    assert TABLE[name_of(path)] == nice + " ".join(started(path))
    assert service["EnvironmentFile"] == "/etc/paddock.env"
    assert service["ExecStart"].startswith(PLACE)
    assert (service["User"], service["WorkingDirectory"]) == ("paddock", PLACE.rstrip("/"))


def test_the_unit_on_the_page_is_the_file():
    (shown,) = code_blocks(PAGE, "ini")
    assert shown == (CHECKOUT / "docs/examples/systemd/paddock-worker.service").read_text()


@pytest.mark.parametrize("path", [path for path in UNITS if "celery" in started(path)[0]], ids=name_of)
def test_celery_takes_the_options_of_a_unit(path):
    _, *arguments = started(path)
    assert arguments[:2] == ["--app", "config"]
    command = celery_cli.commands[arguments[2]]
    known = {option for parameter in command.params for option in parameter.opts}
    assert {one for one in arguments[3:] if one.startswith("--")} <= known


def test_every_queue_has_a_unit():
    served = {
        arguments[arguments.index("--queues") + 1] for arguments in map(started, UNITS) if "--queues" in arguments
    }
    routed = {route["queue"] for route in settings.CELERY_TASK_ROUTES.values()}
    app.loader.import_default_modules()
    tasks = {app.amqp.router.route({}, name)["queue"].name for name in app.tasks if not name.startswith("celery.")}
    assert routed | tasks == served | {app.conf.task_default_queue}


def test_the_commands_of_the_page_exist():
    typed = [line for block in code_blocks(PAGE, "sh") for line in block.splitlines()]
    managed = [shlex.split(line)[1:] for line in typed if line.startswith("manage ")]
    assert ["setup", "--no-input"] in managed
    for name, *options in managed:
        parser = load_command_class(get_commands()[name], name).create_parser("manage.py", name)
        parser.parse_args(options)
    for unit_name in re.findall(r"\bpaddock-[a-z-]+\b", "\n".join(line for line in typed if "systemctl" in line)):
        assert (CHECKOUT / f"docs/examples/systemd/{unit_name}.service").exists(), unit_name
    assert "paddock-*.service" in "\n".join(typed)


def test_the_settings_of_the_page_are_read():
    (block,) = [block for block in code_blocks(PAGE, "sh") if "DATABASE_URL" in block]
    named = set(re.findall(r"^([A-Z_0-9]+)=", block, flags=re.M))
    rows = set(re.findall(r"`([A-Z_0-9]+)`", section(text("operators.md"), "## Environment variables")))
    assert named <= rows

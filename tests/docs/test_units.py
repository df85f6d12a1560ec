"""The commands of "systemd" and "Several machines" exist, and start the programs of ``manage.py run``."""

from __future__ import annotations

import re
import shlex

import pytest
from celery.bin.celery import celery as celery_cli
from django.conf import settings
from django.core.management import get_commands, load_command_class

from config.celery import app
from config.operations.run import VIDEO_WORKER_NICE, in_fewer_processes, programs
from config.serving.forking import PYTHON

from .pages import code_blocks, section, text

PAGE = section(text("operators.md"), "## Several machines")
SYSTEMD = section(text("operators.md"), "## systemd")
TABLE = dict(re.findall(r"^\| `paddock-([a-z-]+)` \| .* \| `(.+)` \|$", PAGE, flags=re.M))
TYPED = [line for page in (PAGE, SYSTEMD) for block in code_blocks(page, "sh") for line in block.splitlines()]


def test_the_table_has_the_programs_of_run(settings):
    settings.TRAINING = settings.VIDEOS = True
    run = in_fewer_processes(programs("127.0.0.1", 8000))
    run.pop("broker", None)
    begin = {"video-worker": f"nice -n {VIDEO_WORKER_NICE} "}
    for name, command in run.items():
        assert TABLE[name] == begin.get(name, "") + " ".join([".venv/bin/python", "-m", *command[len(PYTHON) :]])
    assert set(TABLE) == set(run)


def test_run_needs_no_process_for_the_scheduler():
    commands = programs("127.0.0.1", 8000)
    fewer = in_fewer_processes(commands)
    assert set(commands) - set(fewer) == {"beat"}
    assert fewer["messenger"] == [*commands["messenger"], "--with-scheduler"]


@pytest.mark.parametrize("line", [line for line in TABLE.values() if " celery " in line])
def test_celery_takes_the_options_of_a_program(line):
    arguments = shlex.split(line.partition(" celery ")[2])
    command = celery_cli.commands[arguments[arguments.index("config") + 1]]
    known = {option for parameter in command.params for option in parameter.opts} | {
        "--quiet",
        "--app",
        "--with-scheduler",
    }
    assert {one for one in arguments if one.startswith("--")} <= known


def test_every_queue_has_a_program():
    served = set(re.findall(r"--queues (\w+)", "\n".join(TABLE.values())))
    routed = {route["queue"] for route in settings.CELERY_TASK_ROUTES.values()}
    app.loader.import_default_modules()
    tasks = {app.amqp.router.route({}, name)["queue"].name for name in app.tasks if not name.startswith("celery.")}
    assert routed | tasks == served | {app.conf.task_default_queue}


def test_the_commands_of_the_pages_exist():
    begin = re.compile(r"^(?:manage|(?:runuser -u paddock -- )?\.venv/bin/python manage\.py) ")
    managed = [shlex.split(begin.sub("", line)) for line in TYPED if begin.match(line)]
    assert {name for name, *_ in managed} == {"setup", "units", "doctor", "workers"}
    for name, *options in managed:
        parser = load_command_class(get_commands()[name], name).create_parser("manage.py", name)
        parser.parse_args(options)
    units = {word for line in TYPED if "systemctl" in line for word in re.findall(r"\bpaddock[\w.-]*", line)}
    assert units == {"paddock.target"}
    assert {name for words in re.findall(r"`units ([a-z -]+)`", PAGE) for name in words.split()} <= set(TABLE)


def test_the_settings_of_the_page_are_read():
    (block,) = [block for block in code_blocks(PAGE, "sh") if "DATABASE_URL" in block]
    named = set(re.findall(r"^([A-Z_0-9]+)=", block, flags=re.M))
    rows = set(re.findall(r"`([A-Z_0-9]+)`", section(text("operators.md"), "## Environment variables")))
    assert named <= rows

"""docs/architecture.md names files and functions that exist, and every room, signal, receiver and registry there is."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

from core.jobs.kinds import all_kinds

from .pages import CHECKOUT, PAGES, section, text

PAGE = "architecture.md"
WALKS = re.findall(r"^### .+$", section(text(PAGE), "## Walks"), flags=re.M)
TOP = [CHECKOUT / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG")]
# folders with the same name and purpose in every room
COMMON = {
    "admin",
    "api",
    "forms",
    "management",
    "migrations",
    "models",
    "services",
    "selectors",
    "templatetags",
    "views",
}
NAME = re.compile(r"`([\w.]+)`")


def table(heading: str) -> list[list[str]]:
    """The rows of the first table under a heading, without its head."""
    _head, rows = section(text(PAGE), heading).split("\n|---", 1)
    lines = rows.split("\n\n", 1)[0].strip().splitlines()[1:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def first_cells(heading: str) -> list[str]:
    return [row[0].strip("`/") for row in table(heading)]


def rooms_by_floor() -> list[set[str]]:
    project = (CHECKOUT / "pyproject.toml").read_text()
    layers = re.search(r"^layers = \[\n(.*?)^\]", project, flags=re.M | re.S)
    assert layers
    return [set(floor.split(" | ")) for floor in re.findall(r'"(.+)"', layers.group(1))]


ROOMS = sorted(set().union(*rooms_by_floor()))


@cache
def parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


@cache
def defined(file: Path) -> set[str]:
    """Functions, classes, methods (``Class.method``) and names of a module."""
    found: set[str] = set()
    for node in parsed(file).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{one.name}" for one in node.body if isinstance(one, ast.FunctionDef)}
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if _annotated(node) else []
        found |= {one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)}
    # a converter's register is made inside of another function
    return found | {one.name for one in ast.walk(parsed(file)) if isinstance(one, ast.FunctionDef)}


def _annotated(node: ast.stmt) -> bool:
    return isinstance(node, ast.AnnAssign)


def modules(saying: str) -> Iterator[tuple[str, Path]]:
    """Every module of the rooms, by its dotted name, in which a word stands."""
    for room in ROOMS:
        for file in sorted((CHECKOUT / room).rglob("*.py")):
            if "migrations" not in file.parts and saying in file.read_text():
                parts = file.relative_to(CHECKOUT).with_suffix("").parts
                yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), file


def file_of(dotted: str) -> Path:
    """The file that defines a dotted name such as ``core.events.kinds.register``."""
    module = CHECKOUT.joinpath(*dotted.split(".")[:-1])
    return module.with_suffix(".py") if module.with_suffix(".py").exists() else module / "__init__.py"


def test_rooms_are_listed_in_import_order():
    told = first_cells("## Rooms")
    floors = rooms_by_floor()
    assert sorted(told) == ROOMS
    floor_of = {room: number for number, floor in enumerate(floors) for room in floor}
    assert told == sorted(told, key=lambda room: floor_of[room])


@pytest.mark.parametrize("row", table("## Rooms"), ids=lambda row: row[0].strip("`/"))
def test_the_feature_folders_of_a_room_are_listed(row: list[str]):
    room, listed = CHECKOUT / row[0].strip("`/"), set(re.findall(r"`(\w+)`", row[2]))
    folders = {file.parent.name for file in room.glob("*/__init__.py")}
    assert listed <= folders and folders - COMMON <= listed


def test_the_page_has_its_walks():
    assert len(WALKS) >= 5 and "### A live run to its board" in WALKS


@pytest.mark.parametrize("walk", [*WALKS, "## The racers' package"])
def test_each_step_of_a_walk_names_an_existing_function(walk: str):
    steps = table(walk)
    assert len(steps) >= 6
    for _step, function, file in steps:
        assert (CHECKOUT / file.strip("`")).is_file(), file
        assert function.strip("`") in defined(CHECKOUT / file.strip("`")), f"{function} in {file}"


def test_the_walk_of_a_live_run_visits_few_files():
    assert len({file for _step, _function, file in table("### A live run to its board")}) <= 8


@pytest.mark.parametrize("page", [*PAGES, *TOP], ids=lambda page: page.name)
def test_every_named_file_exists(page: Path):
    named = re.findall(rf"`((?:{'|'.join(ROOMS)}|tests|scripts|static|benchmarks)/[\w/.-]*)`", page.read_text())
    assert page.name != PAGE or len(named) > 100
    assert [name for name in named if not (CHECKOUT / name).exists()] == []


def test_every_name_followed_by_a_file_is_defined_there():
    for cell in re.findall(r"[^|]+", text(PAGE)):
        for name, file in re.findall(r"`([\w.]+)` (?:in|\() ?`([\w/]+\.py)`", cell):
            assert name in defined(CHECKOUT / file), f"{name} in {file}"


def test_every_dotted_name_exists():
    listed = ["### Signals that remain", "### Signals of others", "## Registries"]
    for name in [name for heading in listed for name in first_cells(heading)]:
        assert name.rsplit(".", 1)[1] in defined(file_of(name)), name


def test_every_signal_of_the_code_is_listed():
    ours = set()
    for module, file in modules("Signal("):
        for node in parsed(file).body:
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
                called = node.value.func
                if (called.id if isinstance(called, ast.Name) else getattr(called, "attr", "")) == "Signal":
                    ours |= {f"{module}.{target.id}" for target in node.targets if isinstance(target, ast.Name)}
    assert set(first_cells("### Signals that remain")) == ours and "evaluation.signals.evaluation_ended" in ours


def test_every_receiver_of_a_signal_is_listed():
    of_others = set(first_cells("### Signals of others"))
    of_ours = {name for row in table("### Signals that remain") for name in NAME.findall(row[2])}
    decorated = {f"{module}.{one}" for module, file in modules("connect") for one in _decorated(parsed(file))}
    connected = {one for _module, file in modules("dispatch_uid") for one in _connected(parsed(file))}
    assert decorated <= of_others and "evaluation.tasks.sweep_at_start" in decorated
    assert {name.rsplit(".", 1)[1] for name in of_others - decorated} | of_ours == connected


def _decorated(tree: ast.Module) -> Iterator[str]:
    """Functions that a decorator connects to a signal."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            called = [one.func if isinstance(one, ast.Call) else one for one in node.decorator_list]
            if any(isinstance(one, ast.Attribute) and one.attr == "connect" for one in called):
                yield node.name


def _connected(tree: ast.Module) -> Iterator[str]:
    """Functions that a call connects to a signal, with a ``dispatch_uid``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and any(key.arg == "dispatch_uid" for key in node.keywords):
            receiver = node.args[0]
            assert isinstance(receiver, ast.Name), "a receiver that the page can name"
            yield receiver.id


def test_every_registry_of_the_code_is_listed():
    found = set()
    for module, file in modules("def register"):
        for node in ast.walk(parsed(file)):
            registers = isinstance(node, ast.FunctionDef) and node.name.split("_")[0] == "register" and node.args.args
            if registers and not module.startswith("config"):
                found.add(f"{module}.{node.name}")
    listed = set(first_cells("## Registries"))
    assert {name for name in listed if "register" in name.rsplit(".", 1)[1]} == found
    assert "core.events.reading.register_reader" in found


def test_every_kind_of_job_has_a_row():
    for module in (
        *("evaluation.running.queue.jobs", "league.webhooks.deliveries", "league.notices.services"),
        "tracks.reference.jobs",
    ):
        import_module(module)
    told = [
        [kind.name, kind.model.__name__, f"{type(kind).__module__.replace('.', '/')}.py", kind.task, kind.queue]
        for kind in all_kinds()
        if type(kind).__module__.split(".")[0] in ROOMS
    ]
    assert [[cell.strip("`") for cell in row] for row in table("## Jobs")] == told and len(told) >= 5

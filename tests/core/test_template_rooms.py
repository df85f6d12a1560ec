"""Templates and tag libraries obey the floors that imports obey: a page knows its own room and those below."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from functools import cache
from inspect import unwrap
from pathlib import Path

from django.conf import settings
from django.template import Engine, engines
from django.template.backends.django import get_installed_libraries
from django.template.loader import get_template
from django.urls import URLPattern, URLResolver, get_resolver

from core.pages import registry

DJANGOS = {tag for library in Engine().template_builtins for tag in library.tags}
DJANGOS_FILTERS = {name for library in Engine().template_builtins for name in library.filters}
ROOT = Path(settings.BASE_DIR)
# Folders that other applications name
ROOM_OF_FOLDER = {
    "account": "accounts",
    "admin": "core",
    "admin/league": "league",
    "admin/races": "races",
    "allauth": "accounts",
    "learn": "training",
    "guides": "training",
    "lessons": "training",
    "mfa": "accounts",
    "parts": "core",
}
# What every site has, whatever rooms: its first page, how it works and whether it does, dark or light, and the API's
# page where it is on; for admins the log of their acts and what needs a hand
FRAME = {"home", "about", "guides", "status", "theme", "api-docs", "audit", "needs"}
# Which template is included is the page's own choice: a lesson in the reader's language, beside the page
BY_VARIABLE = {"training/lessons/lesson.html": {"text"}, "training/lessons/real_car.html": {"text"}}


def floors() -> dict[str, int]:
    """How high each room lies, as import-linter is told."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(each for each in contracts if each["type"] == "layers")["layers"]
    return {room.strip(): height for height, layer in enumerate(reversed(layers)) for room in layer.split("|")}


FLOORS = floors()


def may_know(room: str, other: str) -> bool:
    return room == other or FLOORS[other] < FLOORS[room]


def templates() -> dict[str, Path]:
    """Our templates by name."""
    folders = [ROOT / "templates", *(ROOT / room / "templates" for room in FLOORS)]
    return {str(p.relative_to(folder)): p for folder in folders for p in sorted(folder.rglob("*.*"))}


TEMPLATES = templates()


def room_of(template: str) -> str:
    folder = template.rpartition("/")[0]
    while folder:
        if folder in ROOM_OF_FOLDER:
            return ROOM_OF_FOLDER[folder]
        if folder in FLOORS:
            return folder
        folder = folder.rpartition("/")[0]
    return "core"


def room_of_module(module: str) -> str | None:
    """None for what other applications bring."""
    room = module.partition(".")[0]
    return room if room in FLOORS else None


@cache
def rooms_of_addresses() -> dict[str, str | None]:
    def walk(patterns: list[URLPattern | URLResolver]) -> Iterator[tuple[str, str | None]]:
        for each in patterns:
            if isinstance(each, URLResolver):
                yield from walk(each.url_patterns)
            elif each.name:
                view = unwrap(each.callback)
                yield each.name, room_of_module(getattr(view, "view_class", view).__module__)

    return dict(reversed(list(walk(get_resolver().url_patterns))))


def tags(template: str) -> list[list[str]]:
    """The tags of a template, each as its words."""
    text = re.sub(r"{#.*?#}", "", TEMPLATES[template].read_text())
    return [found.split() for found in re.findall(r"{%\s*(.*?)\s*%}", text)]


def named(word: str) -> str | None:
    """What a quoted word says; None for a variable."""
    return word[1:-1] if word[0] in "\"'" else None


def test_templates_extend_and_include_only_from_their_rooms_and_below():
    for template in TEMPLATES:
        for word, *rest in tags(template):
            if word in ("extends", "include"):
                other = named(rest[0])
                if other is None:
                    assert rest[0] in BY_VARIABLE.get(template, ()), template
                elif other in TEMPLATES:
                    assert may_know(room_of(template), room_of(other)), f"{template}: {other}"


def test_templates_load_only_tags_of_their_rooms_and_below():
    libraries = get_installed_libraries()
    for template in TEMPLATES:
        for word, *rest in tags(template):
            if word == "load":
                for name in rest[rest.index("from") + 1 :] if "from" in rest else rest:
                    room = room_of_module(libraries[name])
                    assert room is None or may_know(room_of(template), room), f"{template}: {name}"


def test_templates_link_only_to_pages_of_their_rooms_and_below():
    for template in TEMPLATES:
        for word, *rest in tags(template):
            if word == "url" and (address := named(rest[0])) and address not in FRAME:
                room = rooms_of_addresses().get(address)
                assert room is None or may_know(room_of(template), room), f"{template}: {address}"


def test_no_tag_of_a_room_is_built_in():
    """What is built in is known to every template, whatever its room: only tags of Django's."""
    engine = engines["django"].engine
    ours = [library for library in engine.template_builtins if not library.tags.keys() <= DJANGOS]
    assert ours == [] and not any(library.filters.keys() - DJANGOS_FILTERS for library in engine.template_builtins)


def test_code_renders_only_templates_of_its_room_and_below():
    rendered = []
    for room in FLOORS:
        for path in sorted((ROOT / room).rglob("*.py")):
            for name in re.findall(r"""["']([\w/]+\.(?:html|txt))["']""", path.read_text()):
                if name in TEMPLATES and path.name != "apps.py":
                    rendered.append(name)
                    assert may_know(room, room_of(name)), f"{path.relative_to(ROOT)}: {name}"
    assert len(rendered) > 50


def test_every_slot_is_filled_by_rooms_above_it_and_shown():
    shown = {}
    for template in TEMPLATES:
        for word, *rest in tags(template):
            if word == "slot" and "{% load allauth" not in TEMPLATES[template].read_text():
                shown.setdefault(named(rest[0]), set()).add(room_of(template))
    filled = registry._slots
    assert set(shown) == set(filled)
    for slot, names in filled.items():
        for name in names:
            assert all(FLOORS[room] <= FLOORS[room_of(name)] for room in shown[slot]), name


def test_templates_load_what_they_use():
    """They compile: each tag and filter comes from a library that the template loads."""
    for template in TEMPLATES:
        get_template(template)


def test_links_with_the_query_come_from_our_tag():
    """Django's tag of the same name reads the whole query, so each foreign parameter would make a shared page anew."""
    users = [name for name in TEMPLATES if any(word == "querystring" for word, *_ in tags(name))]
    assert len(users) > 5
    for name in users:
        assert re.search(r"{% load [^%]*\blinks\b", TEMPLATES[name].read_text()), name

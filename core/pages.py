"""What pages show of rooms above theirs: slots in templates and the navigation, filled when the site starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from django.utils.functional import Promise

_slots: dict[str, list[str]] = {}
_sections: list[Section] = []


@dataclass(frozen=True)
class Section:
    """An entry of the site's navigation. ``page``: the name of the address that it leads to; ``prefixes``: how paths
    of pages begin that belong to it."""

    name: str
    page: str
    label: str | Promise
    prefixes: tuple[str, ...]


def register_slots(slots: Mapping[str, str]) -> None:
    """A template for each slot, by the slot's name."""
    for name, template in slots.items():
        filled = _slots.setdefault(name, [])
        if template not in filled:
            filled.append(template)


def filling(slot: str) -> tuple[str, ...]:
    """Templates that rooms above show in a slot, in the order in which they came."""
    return tuple(_slots.get(slot, ()))


def filled_slots() -> dict[str, tuple[str, ...]]:
    """All slots that are filled, with their templates."""
    return {name: tuple(templates) for name, templates in _slots.items()}


def register_sections(sections: Iterable[Section]) -> None:
    """The sections of the site, in their order."""
    _sections[:] = sections


def sections() -> tuple[Section, ...]:
    return tuple(_sections)


def section_of(path: str) -> str:
    """The name of the section that a page belongs to; ``""`` for none."""
    return next((each.name for each in _sections for prefix in each.prefixes if path.startswith(prefix)), "")

"""Registries of template slots and navigation sections, filled when the site starts."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from django.utils.functional import Promise

_slots: dict[str, list[str]] = {}


@dataclass(frozen=True)
class Section:
    """An entry of the navigation, with the name of its page and the prefixes of its paths."""

    name: str
    page: str
    label: str | Promise
    prefixes: tuple[str, ...]


_sections: list[Section] = []


def register_slots(slots: Mapping[str, str]) -> None:
    for name, template in slots.items():
        filled = _slots.setdefault(name, [])
        if template not in filled:
            filled.append(template)


def filling(slot: str) -> tuple[str, ...]:
    """Templates that rooms above show in a slot, in the order in which they came."""
    return tuple(_slots.get(slot, ()))


def register_sections(sections: Iterable[Section]) -> None:
    _sections[:] = sections


def sections() -> tuple[Section, ...]:
    return tuple(_sections)


def section_of(path: str) -> str:
    """The name of the section that a page belongs to; ``""`` for none."""
    return next((each.name for each in _sections for prefix in each.prefixes if path.startswith(prefix)), "")

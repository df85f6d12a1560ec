"""The form of one race of a planned season, and its changes as JSON, which travel in a field of the season's form."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TypeGuard

from django.utils.datastructures import MultiValueDict

from paddock.rules.race import LAYOUT
from races.models import Race
from races.pages.forms import RaceForm

from ..services.season_plan import RoundPlan

# What stands on the track is one thing: of a pattern of bots and a change to boxes nothing mixed comes out.
_TOGETHER = ("race_type", *LAYOUT)
MOST_CHARACTERS = 200_000
_NOT_OF_THE_RACE = ("csrfmiddlewaretoken", "season", "round", "do")


class RoundForm(RaceForm):
    """A race of a planned season: the fields of a community race without its visibility."""

    # a form leaves a field of its base out by naming it None
    visibility = None  # type: ignore[assignment]
    description = None
    edition = None  # type: ignore[assignment]


@dataclass(frozen=True)
class RoundChange:
    """What a race has instead of its pattern. ``data``: what the race's form sent; ``fields``: those that differ."""

    data: Mapping[str, list[str]]
    fields: tuple[str, ...]

    def form(self, now: datetime, race: Race | None = None) -> RoundForm:
        return RoundForm(MultiValueDict(dict(self.data)), race=race, now=now)


def read_changes(text: str) -> dict[str, RoundChange]:
    """The changes that travelled with a plan, by the key of their round; what makes no sense is left out."""
    try:
        sent = json.loads(text) if text and len(text) <= MOST_CHARACTERS else {}
    except (ValueError, RecursionError):
        sent = {}
    changes = {}
    for key, one in sent.items() if isinstance(sent, dict) else ():
        data, fields = (one.get("data"), one.get("fields")) if isinstance(one, dict) else (None, None)
        if is_sent(data) and isinstance(fields, list) and all(isinstance(name, str) for name in fields):
            changes[key] = RoundChange(data, tuple(fields))
    return changes


def write_changes(changes: Mapping[str, RoundChange]) -> str:
    content = {key: {"data": dict(one.data), "fields": list(one.fields)} for key, one in sorted(changes.items())}
    return json.dumps(content) if content else ""


def values_of(changes: Mapping[str, RoundChange], now: datetime) -> dict[str, dict[str, object]]:
    """The fields that single races have instead of their pattern, by key. What the form refuses is left out."""
    values = {}
    for key, one in changes.items():
        form = one.form(now)
        if form.is_valid():
            changed = form.changes()
            values[key] = {name: changed[name] for name in one.fields if name in changed}
    return values


def change_of(form: RoundForm, pattern: RoundPlan) -> RoundChange | None:
    """What a valid form makes of a race that would be ``pattern`` otherwise; None where that is the same."""
    changed, race = form.changes(), pattern.unsaved()
    fields = [name for name, value in changed.items() if getattr(race, name) != value]
    if set(fields) & set(_TOGETHER):
        fields += [name for name in _TOGETHER if name in changed and name not in fields]
    if not fields:
        return None
    return RoundChange(
        {name: form.data.getlist(name) for name in form.data if name not in _NOT_OF_THE_RACE}, tuple(fields)
    )


def is_sent(data: object) -> TypeGuard[dict[str, list[str]]]:
    """Whether this is what a form may send: texts by name."""
    return isinstance(data, dict) and all(
        isinstance(values, list) and all(isinstance(one, str) for one in values) for values in data.values()
    )

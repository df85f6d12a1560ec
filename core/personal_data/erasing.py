"""Applies the rules of deletion: removes rows, empties columns and replaces names that other rows quote."""

import json
import re
from collections.abc import Iterable
from typing import Any

from django.db.models import Field, JSONField, Model, Q, TextField
from django.db.models.functions import Cast

from .rules import Leaving, PersonalData, all_rooms

AT_ONCE = 200


def erase(leaving: Leaving) -> None:
    """Apply the rules of all rooms to a racer, except to the account itself. Call it in a transaction."""
    rooms = all_rooms()
    for room in rooms:
        if room.erase is not None:
            room.erase(leaving)
        for rule in room.rules:
            _apply(rule, leaving)
    for room in rooms:
        for rule in room.rules:
            for column in rule.mentions.split():
                replace_mentions(rule.model, column, leaving)


def _apply(rule: PersonalData, leaving: Leaving) -> None:
    racer = leaving.racer
    if rule.model is type(racer):
        return
    if rule.rows:
        rule.owned_by(racer).delete()
    for column in (rule.model._meta.get_field(name) for name in rule.erased.split()):
        if column.is_relation:
            rule.model._base_manager.filter(**{column.name: racer}).update(**{column.name: None})
        elif rule.owner and not rule.rows:
            assert isinstance(column, Field)
            rule.owned_by(racer).update(**{column.name: "" if column.empty_strings_allowed else column.get_default()})


def replace_mentions(model: type[Model], name: str, leaving: Leaving) -> None:
    """Put the nameless alias in place of the racer's names in a column of anybody's rows."""
    column = model._meta.get_field(name)
    assert isinstance(column, Field)
    quoted = Q()
    for text in leaving.names:
        quoted |= Q(_quoting__icontains=text)
    rows = model._base_manager.annotate(_quoting=Cast(name, TextField())).filter(quoted)
    for pk, value in list(rows.values_list("pk", name).iterator(chunk_size=AT_ONCE)):
        changed = _without(value, leaving, isinstance(column, JSONField))
        if changed != value:
            model._base_manager.filter(pk=pk).update(**{name: changed})


def _without(value: Any, leaving: Leaving, is_json: bool) -> Any:
    pattern = re.compile("|".join(rf"(?<![\w.@-]){re.escape(name)}(?![\w@-])" for name in _longest_first(leaving)))
    if is_json:
        return _replaced(value, pattern, leaving.nameless)
    try:  # a body that is sent as JSON: its keys stay
        parsed = json.loads(value)
    except ValueError:
        return pattern.sub(leaving.nameless, value)
    return json.dumps(_replaced(parsed, pattern, leaving.nameless), ensure_ascii=False)


def _longest_first(leaving: Leaving) -> Iterable[str]:
    return sorted(leaving.names, key=len, reverse=True)


def _replaced(value: Any, pattern: re.Pattern[str], nameless: str) -> Any:
    if isinstance(value, str):
        return pattern.sub(nameless, value)
    if isinstance(value, list):
        return [_replaced(each, pattern, nameless) for each in value]
    if isinstance(value, dict):
        return {key: _replaced(each, pattern, nameless) for key, each in value.items()}
    return value

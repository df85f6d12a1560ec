"""Applies the rules of deletion: removes rows, empties columns and replaces names that other rows quote."""

import json
import re
from functools import cache
from gettext import GNUTranslations
from typing import Any

from django.conf import settings
from django.db.models import Field, JSONField, Model, Q, TextField
from django.db.models.functions import Cast

from .rules import Leaving, PersonalData, all_rooms

AT_ONCE = 200
# JSON keys with aliases as values
PEOPLE = frozenset(
    {"actor", "alias", "aliases", "by", "captain", "deputy", "imported_by", "leader", "object", "organiser", "other"}
    | {"owner", "racer", "racers", "rival", "rivals", "teacher", "username", "winner", "winners"}
)
_RUNNING_TEXT = re.compile(r"[\s/]")


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
    quoted = _Quoted(leaving)
    if is_json:
        return quoted.replaced(value)
    try:  # a body that is sent as JSON: its keys stay
        parsed = json.loads(value)
    except ValueError:
        return quoted.in_text(value)
    return json.dumps(quoted.replaced(parsed), ensure_ascii=False)


class _Quoted:
    """Finds the racer's names in what others have written.

    A racer could have chosen a word that texts and data are made of, such as "not" or "lap". So a value of JSON is a
    name only under a key for people, and an alias that is a word of the site's own texts stays in running text."""

    def __init__(self, leaving: Leaving) -> None:
        self._nameless = leaving.nameless
        self._names = {name.casefold() for name in leaving.names}
        words = _words_of_the_site()
        unmistakable = sorted({name for name in leaving.names if name.lower() not in words}, key=len, reverse=True)
        self._in_text = re.compile(
            "|".join(rf"(?<![\w.@-]){re.escape(name)}(?![\w@-])" for name in unmistakable) or "$^"
        )

    def replaced(self, value: Any, key: str = "") -> Any:
        """A value of JSON, with the key that it stands under."""
        if isinstance(value, str):
            if value.casefold() in self._names:
                return self._nameless if key in PEOPLE or "@" in value else value
            return self.in_text(value) if _RUNNING_TEXT.search(value) else value
        if isinstance(value, list):
            return [self.replaced(each, key) for each in value]
        if isinstance(value, dict):
            return {name: self.replaced(each, name) for name, each in value.items()}
        return value

    def in_text(self, text: str) -> str:
        return self._in_text.sub(self._nameless, text)


@cache
def _words_of_the_site() -> frozenset[str]:
    """The English words of all visible texts."""
    with (settings.LOCALE_PATHS[0] / "ko" / "LC_MESSAGES" / "django.mo").open("rb") as file:
        catalogue: Any = GNUTranslations(file)
    texts = (key if isinstance(key, str) else key[0] for key in catalogue._catalog)
    return frozenset(word for text in texts for word in re.findall("[a-z]+", text.lower()))

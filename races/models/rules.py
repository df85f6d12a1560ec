"""Race rules as columns: made from the engine's list, for every model that has some of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from types import new_class
from typing import TYPE_CHECKING, Any

from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.utils.translation import gettext_lazy as _

from paddock.rules.race import RULES, STAGE, TOTAL
from paddock.rules.ranked import NEEDED, contradiction
from paddock.rules.rule import Rule
from tracks.models import Direction

from ..errors import problem
from ..rules.words import column_label, help_text
from .choices import DuelFormat, Opponents, RaceType, RankingMethod

_WORDS: dict[str, type[models.TextChoices]] = {
    "direction": Direction,
    "race_type": RaceType,
    "ranking_method": RankingMethod,
    "opponents": Opponents,
    "duel_format": DuelFormat,
}
_SMALL = 9_999  # what a smallint holds comfortably


def default_sensors() -> list[str]:
    """The sensors that a race offers unless told otherwise."""
    return list(RULES["sensors"].default)


def _inside_of(names: Iterable[str]) -> dict[str, Any]:
    return {name: RULES[name].default for name in names if not RULES[name].column}


def inside_a_race() -> dict[str, Any]:
    """The rules of a race that have no column, as they usually are."""
    return _inside_of(RULES)


def inside_a_stage() -> dict[str, Any]:
    """Those of a season's stage."""
    return _inside_of(STAGE)


def name_choices(name: str, words: type[models.TextChoices]) -> None:
    """Have the choices of a rule told in the words of a room above."""
    _WORDS[name] = words


def choices_of(rule: Rule) -> list[tuple[str, Any]]:
    """The values that a rule may have, each with its word."""
    return _WORDS[rule.name].choices if rule.name in _WORDS else [(value, value) for value in rule.choices]


def usual(name: str) -> Any:
    """What a race has where nobody says otherwise."""
    default = RULES[name].default
    return list(default) if isinstance(default, tuple) else default


def column(rule: Rule) -> models.Field:
    """The column that holds a rule. What stands on the track is checked with the whole race, for better reasons."""
    said: dict[str, Any] = {"help_text": help_text(rule)}
    if rule.name == "sensors":
        return models.JSONField(column_label(rule), default=default_sensors, **said)
    if rule.name == "boxes":
        return models.JSONField(column_label(rule), default=list, blank=True, **said)
    said |= {"null": True, "blank": True} if rule.default is None or rule.optional else {}
    said |= {} if rule.default is None else {"default": rule.default}
    if rule.choices:
        longest = max(map(len, rule.choices))
        return models.CharField(
            column_label(rule), max_length=longest, choices=choices_of(rule), blank=not rule.default, **said
        )
    if rule.type is bool:
        return models.BooleanField(column_label(rule), db_default=rule.default, **said)
    if rule.added:
        said["db_default"] = rule.default
    if not rule.layout:
        said["validators"] = [
            *([MinValueValidator(rule.least)] if rule.least else []),
            *([] if rule.most is None else [MaxValueValidator(rule.most)]),
        ]
    if rule.type is float:
        return models.FloatField(column_label(rule), **said)
    small = rule.most is not None and rule.most <= _SMALL
    return (models.PositiveSmallIntegerField if small else models.PositiveIntegerField)(column_label(rule), **said)


class _Ruled(models.Model):
    """Rules that no query and no constraint needs stand in ``rules``, and read and write like columns."""

    rules: models.JSONField
    RULES: tuple[str, ...] = ()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The rules by their names."""

    class Meta:
        abstract = True

    def clean_fields(self, exclude: Collection[str] | None = None) -> None:
        """Also what stands in ``rules``, as if each were a column. Raises ValidationError by rule."""
        errors: dict[str, Any] = {}
        try:
            super().clean_fields(exclude=exclude)
        except ValidationError as error:
            errors = error.update_error_dict(errors)
        for name in self.RULES:
            if not RULES[name].column and name not in (exclude or ()):
                try:
                    column(RULES[name]).clean(getattr(self, name), self)
                except ValidationError as error:
                    errors[name] = error.error_list
        if errors:
            raise ValidationError(errors)

    @classmethod
    def columns_of(cls, names: Iterable[str]) -> list[str]:
        """The columns that hold the fields of these names, for ``save(update_fields=...)``."""
        return list({"rules" if name in RULES and not RULES[name].column else name: None for name in names})


def with_rules(names: Iterable[str], inside: Callable[[], dict[str, Any]]) -> Any:
    """An abstract model that has these rules; ``inside``: the default of those without a column."""
    rules = models.JSONField(_("other rules"), default=inside, blank=True, editable=False, db_default={})
    made = {name: column(RULES[name]) if RULES[name].column else _inside(RULES[name]) for name in names}
    more = {"__module__": __name__, "Meta": type("Meta", (), {"abstract": True}), "RULES": tuple(names)}
    return new_class("Ruled", (_Ruled,), exec_body=lambda body: body.update({"rules": rules, **more, **made}))


def with_columns(rules: Mapping[str, Rule]) -> Any:
    """An abstract model that has a column for each of these rules."""
    more = {"__module__": __name__, "Meta": type("Meta", (), {"abstract": True})}
    made = {name: column(rule) for name, rule in rules.items()}
    return new_class("Columned", (models.Model,), exec_body=lambda body: body.update({**more, **made}))


def _inside(rule: Rule) -> property:
    def read(row: _Ruled) -> Any:
        return row.rules.get(rule.name, rule.default)

    def write(row: _Ruled, value: Any) -> None:
        row.rules = {**row.rules, rule.name: value}

    return property(read, write, doc=rule.label)


def within(name: str, rules: Mapping[str, Rule] = RULES) -> Q:
    """That a rule's column is within its bounds."""
    return Q(**{f"{name}__gte": rules[name].least, f"{name}__lte": rules[name].most})


def laps_constraints(prefix: str) -> list[models.CheckConstraint]:
    """How many laps are driven, and how many of them must be complete."""
    return [
        models.CheckConstraint(
            condition=Q(minimum_laps__gte=1, minimum_laps__lte=F("laps")), name=f"{prefix}_minimum_laps_within_laps"
        ),
        models.CheckConstraint(condition=within("laps"), name=f"{prefix}_laps_range"),
        models.CheckConstraint(
            condition=~Q(ranking_method=TOTAL) | Q(minimum_laps=F("laps")), name=f"{prefix}_total_needs_all_laps"
        ),
    ]


def lap_problems(row: Any) -> dict[str, ValidationError]:
    """What contradicts itself in a row's laps, by the field to change; a value that is not a number is told
    elsewhere."""
    driven, needed = row.laps, row.minimum_laps
    if not isinstance(driven, int) or not isinstance(needed, int):
        return {}
    code = contradiction(row.ranking_method, driven, needed) if needed > 0 else ""  # below it, by its bounds
    return {NEEDED: problem(code, laps=driven)} if code else {}

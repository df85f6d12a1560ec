"""Race rules as columns: made from the engine's list, for every model that has some of them."""

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
from .choices import DuelFormat, Opponents, RaceType, ranking_choices
from .rule_labels import column_label, help_text

Choices = list[tuple[str, Any]]
Value = bool | int | float | str | list[Any] | None  # of a rule, as JSON
_CHOICES: dict[str, Choices | Callable[[], Choices]] = {
    "direction": Direction.choices,
    "race_type": RaceType.choices,
    "ranking_method": ranking_choices,
    "opponents": Opponents.choices,
    "duel_format": DuelFormat.choices,
}
_SMALL = 9_999  # what a smallint holds comfortably


def default_sensors() -> list[str]:
    return list(RULES["sensors"].default)


def _inside_of(names: Iterable[str]) -> dict[str, Value]:
    return {name: RULES[name].default for name in names if not RULES[name].column}


def inside_a_race() -> dict[str, Value]:
    """The rules of a race that have no column, as they usually are."""
    return _inside_of(RULES)


def inside_a_stage() -> dict[str, Value]:
    return _inside_of(STAGE)


def name_choices(name: str, words: type[models.TextChoices]) -> None:
    """Label the choices of a rule with the words of a higher room."""
    _CHOICES[name] = words.choices


def choices_of(rule: Rule) -> Choices:
    """The values that a rule may have now, each with its word."""
    found = _CHOICES.get(rule.name) or [(value, value) for value in rule.choices]
    return found() if callable(found) else found


def usual(name: str) -> Any:
    default = RULES[name].default
    return list(default) if isinstance(default, tuple) else default


def column(rule: Rule) -> models.Field:
    """The column of a rule. Rules of the layout are checked with the whole race, for better messages."""
    options: dict[str, Any] = {"help_text": help_text(rule)}
    if rule.name == "sensors":
        return models.JSONField(column_label(rule), default=default_sensors, **options)
    if rule.name == "boxes":
        return models.JSONField(column_label(rule), default=list, blank=True, **options)
    options |= {"null": True, "blank": True} if rule.default is None or rule.optional else {}
    options |= {} if rule.default is None else {"default": rule.default}
    if rule.choices:
        choices = _CHOICES.get(rule.name) or choices_of(rule)
        longest = max(map(len, rule.choices))
        return models.CharField(
            column_label(rule), max_length=longest, choices=choices, blank=not rule.default, **options
        )
    if rule.type is bool:
        return models.BooleanField(column_label(rule), db_default=rule.default, **options)
    if rule.added:
        options["db_default"] = rule.default
    if not rule.layout:
        options["validators"] = [
            *([MinValueValidator(rule.least)] if rule.least else []),
            *([] if rule.most is None else [MaxValueValidator(rule.most)]),
        ]
    if rule.type is float:
        return models.FloatField(column_label(rule), **options)
    small = rule.most is not None and rule.most <= _SMALL
    return (models.PositiveSmallIntegerField if small else models.PositiveIntegerField)(column_label(rule), **options)


class Ruled(models.Model):
    """Rules that no query and no constraint needs stand in ``rules``, and read and write like columns."""

    rules: models.JSONField
    RULES: tuple[str, ...] = ()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """The rules by their names."""

    class Meta:
        abstract = True

    def clean_fields(self, exclude: Collection[str] | None = None) -> None:
        """Also cleans the values in ``rules`` like columns. Raises ValidationError by rule."""
        errors: dict[str, list[ValidationError]] = {}
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


def with_rules(names: Iterable[str], inside: Callable[[], dict[str, Value]]) -> Any:
    """An abstract model that has these rules; ``inside``: the default of those without a column."""
    rules = models.JSONField(_("other rules"), default=inside, blank=True, editable=False, db_default={})
    made = {name: column(RULES[name]) if RULES[name].column else _inside(RULES[name]) for name in names}
    more = {"__module__": __name__, "Meta": type("Meta", (), {"abstract": True}), "RULES": tuple(names)}
    return new_class("Ruled", (Ruled,), exec_body=lambda body: body.update({"rules": rules, **more, **made}))


def with_columns(rules: Mapping[str, Rule]) -> Any:
    more = {"__module__": __name__, "Meta": type("Meta", (), {"abstract": True})}
    made = {name: column(rule) for name, rule in rules.items()}
    return new_class("Columned", (models.Model,), exec_body=lambda body: body.update({**more, **made}))


def _inside(rule: Rule) -> property:
    def read(row: Ruled) -> Any:
        return row.rules.get(rule.name, rule.default)

    def write(row: Ruled, value: Any) -> None:
        row.rules = {**row.rules, rule.name: value}

    return property(read, write, doc=rule.label)


def within(name: str, rules: Mapping[str, Rule] = RULES) -> Q:
    """Condition that a rule's column is within its bounds."""
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
    """Contradictions in a row's laps, by the field to change; other code reports values that are no numbers."""
    driven, needed = row.laps, row.minimum_laps
    if not isinstance(driven, int) or not isinstance(needed, int):
        return {}
    code = contradiction(row.ranking_method, driven, needed) if needed > 0 else ""  # below it, by its bounds
    return {NEEDED: problem(code, laps=driven)} if code else {}

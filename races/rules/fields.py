"""Race rules as fields of forms: made from the engine's list."""

from collections.abc import Iterable
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from evaluation.templatetags.garage import SENSOR_WORDS
from paddock.rules.race import OF_SOME_TYPES, RULES
from paddock.rules.rule import Rule

from ..models.rule_labels import help_text, label
from ..models.rules import choices_of
from ..models.sensors import OFFERABLE
from .form_fields import BoxesField, PlainNumberField, ResetsField, SecondsField

_RADIOS = ("race_type", "opponents")


def rule_fields(names: Iterable[str], **options: Any) -> dict[str, forms.Field]:
    """The fields of these rules; ``options`` as for :func:`rule_field`."""
    return {name: rule_field(RULES[name], **options) for name in names}


def rule_field(rule: Rule, *, short: bool = False, strict: bool = False) -> forms.Field:
    """The field that asks for a rule. Bounds of the layout are left to the race's validation, unless ``strict``."""
    may_be_empty = rule.layout or rule.default is None or rule.optional or not rule.column or rule.name == "seed"
    options: dict[str, Any] = {
        "label": label(rule, short=short),
        "required": not may_be_empty and (strict or not rule.race_types),
    }
    if not strict:
        options["help_text"] = help_text(rule)
    if rule.name == "boxes":
        return BoxesField(**options)
    if rule.name == "sensors":
        names = [(name, _(SENSOR_WORDS[name])) for name in OFFERABLE]
        return forms.MultipleChoiceField(choices=names, widget=forms.CheckboxSelectMultiple, **options)
    if rule.choices:
        if rule.name in _RADIOS:
            options["widget"] = forms.RadioSelect
        return forms.ChoiceField(choices=lambda: choices_of(rule), **options)
    if rule.type is bool:
        return forms.BooleanField(**options | {"required": False})
    if rule.unlimited is not None:
        del options["required"]
        return ResetsField(unlimited=rule.unlimited, **options)
    if rule.unit == "ms":
        least, most = (round((bound or 0) / 1000, 3) for bound in (rule.least, rule.most))
        return SecondsField(min_value=least if least % 1 else int(least), max_value=int(most), **options)
    if rule.optional:
        options["widget"] = forms.NumberInput(attrs={"placeholder": _("unlimited")})
    kind = PlainNumberField if rule.type is float else forms.IntegerField
    if rule.layout and not strict:
        step = 0.1 if rule.type is float else 1
        return kind(widget=forms.NumberInput(attrs={"min": rule.least, "max": rule.most, "step": step}), **options)
    return kind(**options | {"min_value": rule.least, "max_value": rule.most})


def rules_of_other_types(race_type: str | None) -> list[str]:
    """Rules outside the layout that races of this type do not have."""
    return [name for name in OF_SOME_TYPES if race_type and not RULES[name].belongs_to(race_type)]


def drop_rules_of_other_types(form: forms.Form, cleaned: dict[str, Any]) -> None:
    for name in rules_of_other_types(cleaned.get("race_type")):
        form.errors.pop(name, None)
        cleaned[name] = None

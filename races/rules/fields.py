"""Race rules as fields of forms: made from the engine's list."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from evaluation.templatetags.garage import SENSOR_WORDS
from paddock.rules.race import RULES
from paddock.rules.rule import Rule

from ..fields import BoxesField, PlainNumberField, ResetsField, SecondsField
from ..models.rules import choices_of
from ..sensors import OFFERABLE
from .words import help_text, label

_RADIOS = ("race_type", "opponents")


def rule_fields(names: Iterable[str], **said: Any) -> dict[str, forms.Field]:
    """The fields of these rules; ``said`` as for :func:`rule_field`."""
    return {name: rule_field(RULES[name], **said) for name in names}


def rule_field(rule: Rule, *, short: bool = False, strict: bool = False) -> forms.Field:
    """The field that asks for a rule.

    What belongs to some race types only may stay empty, and so may what old pages do not send; the bounds of what
    stands on the track are the browser's, for the race's own validation has better reasons: unless it is ``strict``.
    """
    may_be_empty = rule.layout or rule.default is None or rule.optional or not rule.column or rule.name == "seed"
    said: dict[str, Any] = {
        "label": label(rule, short=short),
        "required": not may_be_empty and (strict or not rule.race_types),
    }
    if not strict:
        said["help_text"] = help_text(rule)
    if rule.name == "boxes":
        return BoxesField(**said)
    if rule.name == "sensors":
        names = [(name, _(SENSOR_WORDS[name])) for name in OFFERABLE]
        return forms.MultipleChoiceField(choices=names, widget=forms.CheckboxSelectMultiple, **said)
    if rule.choices:
        if rule.name in _RADIOS:
            said["widget"] = forms.RadioSelect
        return forms.ChoiceField(choices=choices_of(rule), **said)
    if rule.type is bool:
        return forms.BooleanField(**said | {"required": False})
    if rule.unlimited is not None:
        del said["required"]
        return ResetsField(unlimited=rule.unlimited, **said)
    if rule.unit == "ms":
        least, most = (round((bound or 0) / 1000, 3) for bound in (rule.least, rule.most))
        return SecondsField(min_value=least if least % 1 else int(least), max_value=int(most), **said)
    if rule.optional:
        said["widget"] = forms.NumberInput(attrs={"placeholder": _("unlimited")})
    kind = PlainNumberField if rule.type is float else forms.IntegerField
    if rule.layout and not strict:
        step = 0.1 if rule.type is float else 1
        return kind(widget=forms.NumberInput(attrs={"min": rule.least, "max": rule.most, "step": step}), **said)
    return kind(**said | {"min_value": rule.least, "max_value": rule.most})

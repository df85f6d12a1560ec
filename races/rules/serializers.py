"""API fields of the race rules, made from the engine's list."""

from collections.abc import Iterable, Mapping
from typing import Any

from rest_framework import serializers

from core.api.bodies import Body
from core.api.fields import ChoiceField
from paddock.rules.race import BOX_FRACTIONS, MAX_BOXES, RULES
from paddock.rules.rule import Rule

from ..models import Lane
from ..models.rules import choices_of
from ..models.sensors import OFFERABLE


class BoxPlaceSerializer(Body):
    """Where a box is put."""

    fraction = serializers.FloatField(
        help_text="Share of the lap driven there from the finish line, {:g} to {:g}.".format(*BOX_FRACTIONS)
    )
    lane = serializers.ChoiceField(
        Lane.choices, help_text="Beside the track's inner or its outer border, in either direction."
    )


def with_rules(
    base: Any, names: Iterable[str], *, rules: Mapping[str, Rule] = RULES, asked: bool = False, strict: bool = False
) -> Any:
    """A serializer of ``base`` with these rules. ``asked``: for requests, each rule optional and checked against its
    bounds; those of the layout are left to the race's validation, unless ``strict``."""
    made = {name: _field(rules[name], asked or rules[name].layout, strict) for name in names}
    return type(base)("Ruled", (base,), {"__doc__": base.__doc__, **made})


def _field(rule: Rule, asked: bool, strict: bool) -> serializers.Field:
    options: dict[str, Any] = {"help_text": _help(rule)} if _help(rule) else {}
    if asked:
        options["required"] = False
    elif rule.default is None:
        options["allow_null"] = True
    if rule.optional:
        options["allow_null"] = True
    if rule.name == "boxes":
        if strict:
            options["max_length"] = MAX_BOXES
        return BoxPlaceSerializer(many=True, **options)
    if rule.name == "sensors":
        if asked:
            return serializers.ListField(child=serializers.ChoiceField(OFFERABLE), max_length=8, **options)
        return serializers.ListField(child=serializers.CharField(), **options)
    if rule.choices:
        if not rule.default:
            options["allow_blank"] = True
        return ChoiceField(lambda: choices_of(rule), **options)
    if rule.type is bool:
        return serializers.BooleanField(**options)
    if strict or (asked and not rule.layout):
        options |= {"min_value": 0 if rule.default == 0 else rule.least, "max_value": rule.most}
    return (serializers.FloatField if rule.type is float else serializers.IntegerField)(**options)


def _help(rule: Rule) -> str:
    """The rule's help text in the API description; with bounds only where the field has none."""
    if rule.name == "boxes":
        return f"Object avoidance: boxes in fixed places, up to {MAX_BOXES}."
    types = " and ".join(one.replace("_", " ") for one in rule.race_types)
    parts = [f"For {types}: {rule.label[0].lower()}{rule.label[1:]}." if rule.layout else "", rule.help]
    return " ".join([*filter(None, parts), *([f"{rule.range}."] if rule.layout and rule.range else [])])

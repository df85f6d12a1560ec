"""Race rules as the API says them and takes them: made from the engine's list."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rest_framework import serializers

from core.bodies import Body
from paddock.rules.race import BOX_FRACTIONS, MAX_BOXES, RULES
from paddock.rules.rule import Rule

from ..models import Lane
from ..models.rules import choices_of
from ..sensors import OFFERABLE


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
    """A serializer of ``base`` that has these rules besides. ``asked``: for what is sent, where each may be left out
    and is held against its bounds; those of what stands on the track are checked with the whole race, where each
    refusal has its own code: unless ``strict``."""
    made = {name: _field(rules[name], asked or rules[name].layout, strict) for name in names}
    return type(base)("Ruled", (base,), {"__doc__": base.__doc__, **made})


def _field(rule: Rule, asked: bool, strict: bool) -> serializers.Field:
    said: dict[str, Any] = {"help_text": _help(rule)} if _help(rule) else {}
    if asked:
        said["required"] = False
    elif rule.default is None:
        said["allow_null"] = True
    if rule.optional:
        said["allow_null"] = True
    if rule.name == "boxes":
        if strict:
            said["max_length"] = MAX_BOXES
        return BoxPlaceSerializer(many=True, **said)
    if rule.name == "sensors":
        if asked:
            return serializers.ListField(child=serializers.ChoiceField(OFFERABLE), max_length=8, **said)
        return serializers.ListField(child=serializers.CharField(), **said)
    if rule.choices:
        if not rule.default:
            said["allow_blank"] = True
        return serializers.ChoiceField(choices_of(rule), **said)
    if rule.type is bool:
        return serializers.BooleanField(**said)
    if strict or (asked and not rule.layout):
        said |= {"min_value": 0 if rule.default == 0 else rule.least, "max_value": rule.most}
    return (serializers.FloatField if rule.type is float else serializers.IntegerField)(**said)


def _help(rule: Rule) -> str:
    """What the description of the API says; bounds only where the field does not know them."""
    if rule.name == "boxes":
        return f"Object avoidance: boxes in fixed places, up to {MAX_BOXES}."
    types = " and ".join(one.replace("_", " ") for one in rule.race_types)
    said = [f"For {types}: {rule.label[0].lower()}{rule.label[1:]}." if rule.layout else "", rule.help]
    return " ".join([*filter(None, said), *([f"{rule.range}."] if rule.layout and rule.range else [])])

"""Rules for passing and reasons of marks in the reader's language."""

from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from django.utils.translation import gettext as _

from core.times import clock

from ..marking.pass_rules import PASS_RULES
from ..marking.whys import WHYS


def pass_rule_label(code: str) -> str:
    """The name of a rule for passing."""
    return _(PASS_RULES[code].label)


def pass_rule_sentence(code: str, params: Mapping[str, Any]) -> str:
    """A rule for passing with its values."""
    rule = PASS_RULES[code]
    text = rule.text_one if rule.text_one and params["laps"] == 1 else rule.text
    return _(text) % _shown(code, params)


def why(code: str, pass_rule: str, params: Mapping[str, Any]) -> str:
    """Why a part has its points; ``code`` and ``params`` of a part of a mark."""
    return _(WHYS[code]) % _shown(pass_rule, params)


def _shown(code: str, params: Mapping[str, Any]) -> dict[str, Any]:
    """Times as m:ss.mmm, thresholds as a list."""
    shown = dict(params)
    for name in ("at_most_ms", "value"):
        if name in shown and (name != "value" or (PASS_RULES[code].unit == "ms" and not PASS_RULES[code].needs_place)):
            shown[name] = clock(shown[name])
    if "thresholds" in shown:
        shown["thresholds"] = ", ".join(
            _("%(points)s up to %(time)s") % {"points": plain(one["points"]), "time": clock(one["at_most_ms"])}
            for one in shown["thresholds"]
        )
    return shown


def plain(points: Decimal | str) -> str:
    """Points without needless zeros."""
    text = f"{Decimal(str(points)):f}"
    return text.rstrip("0").rstrip(".") if "." in text else text

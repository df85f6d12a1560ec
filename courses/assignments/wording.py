"""Rules for passing and reasons of marks in the reader's language."""

from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from django.utils.translation import gettext as _

from core.times import clock
from paddock.errors.reasons import gettext_noop

from ..marking.pass_rules import PASS_RULES

WHYS = {
    "passed": gettext_noop("Passed on every track."),
    "by_time": gettext_noop("Points by time: %(value)s."),
    "place": gettext_noop("Place %(value)s."),
    "too_few_laps": gettext_noop("%(value)s of %(laps)s complete laps in a row."),
    "too_slow": gettext_noop("%(value)s, at most %(at_most_ms)s needed."),
    "no_lap": gettext_noop("Too few complete laps for a time."),
    "not_driven": gettext_noop("Nothing was driven."),
    "waits": gettext_noop("A run is not over yet."),
    "hidden_waits": gettext_noop("Hidden tracks are drawn at the deadline."),
    "place_waits": gettext_noop("Places are known when all runs are over."),
}


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


def _shown(code: str, params: Mapping[str, Any]) -> dict[str, object]:
    """Times as m:ss.mmm, thresholds as a list."""
    shown = dict(params)
    for name in ("at_most_ms", "value"):
        if name in shown and (name != "value" or (PASS_RULES[code].unit == "ms" and not PASS_RULES[code].needs_place)):
            shown[name] = clock(shown[name])
    if "thresholds" in shown:
        shown["thresholds"] = ", ".join(
            _("%(points)s up to %(time)s") % {"points": plain_points(one["points"]), "time": clock(one["at_most_ms"])}
            for one in shown["thresholds"]
        )
    return shown


def plain_points(points: Decimal | str) -> str:
    """Points without needless zeros: ``37.5``, ``60``."""
    return f"{Decimal(str(points)).normalize():f}"

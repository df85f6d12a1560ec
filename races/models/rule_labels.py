"""A rule in the reader's language: its label with its unit, and its value in a few words."""

from typing import Any

from django.utils.functional import lazy
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, pgettext

from paddock.rules.race import RULES
from paddock.rules.rule import Rule


def _label(text: str, unit: str, context: str = "") -> str:
    if context:
        return pgettext(context, text)
    if unit == "s":
        return _("%(label)s in seconds") % {"label": _(text)}
    if unit == "ms":
        return _("%(label)s in milliseconds") % {"label": _(text)}
    return _(text)


_lazy_label = lazy(_label, str)


def label(rule: Rule, *, short: bool = False) -> Any:
    """The label of a rule in forms, lazily translated; times are in seconds."""
    return _lazy_label((rule.short if short else "") or rule.label, "s" if rule.unit == "ms" else "", rule.context)


def column_label(rule: Rule) -> Any:
    """The name of a rule's column, lazily translated; times are stored in milliseconds."""
    return _lazy_label(rule.label, rule.unit, rule.context)


def help_text(rule: Rule) -> Any:
    """The help text of a rule in forms, lazily translated."""
    return gettext_lazy(rule.help) if rule.help else ""


def figure(rule: Rule, value: Any) -> str:
    """A value in a few words."""
    if value == rule.unlimited:
        return _("unlimited")
    if rule.type is bool:
        return _("yes") if value else _("no")
    if rule.unit == "ms":
        return f"{value / 1000:g} s"
    if rule.type is float:
        return f"{value:g} {rule.unit}".rstrip()
    return str(value)


def figures(race: Any, names: tuple[str, ...]) -> list[tuple[str, str]]:
    """Label and value of a race's rules of these names, without those that other race types have."""
    rules = (RULES[name] for name in names)
    return [
        (_(rule.label), figure(rule, getattr(race, rule.name))) for rule in rules if rule.belongs_to(race.race_type)
    ]

"""Deadlines and points on pages of assignments."""

from datetime import UTC, datetime
from decimal import Decimal
from typing import Any
from zoneinfo import ZoneInfo

from django import template
from django.utils import timezone
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext, pgettext_lazy

from accounts.models import Racer, RacerGroup
from core.times import written
from evaluation.models import Evaluation
from paddock.rules.race import RaceRules
from races.models import RaceType
from tracks.models import Direction

from ..assignments.selectors import assignments_visible_to
from ..assignments.wording import pass_rule_label, pass_rule_sentence, plain_points
from ..attempts.overview import due_next
from ..grading.members import can_teach_group
from ..marks.table import SORTS
from ..models import Assignment, AssignmentPart, Attempt, Counts

register = template.Library()


@register.filter("plain_points")
def points_or_dash(points: Decimal | str | None) -> str:
    """Points without needless zeros; a dash for none."""
    return "–" if points is None or points == "" else plain_points(points)


@register.simple_tag
def attempt_of_run(evaluation: Evaluation) -> Attempt | None:
    """The attempt that a run without a race belongs to, if any."""
    if getattr(evaluation, "own", None) is not None:
        return None
    return Attempt.objects.filter(runs__evaluation=evaluation).select_related("assignment").first()


@register.simple_tag
def deadline(when: datetime, zone: str) -> SafeString:
    """A deadline in words: ``in 2 days · Sun 29 Nov, 23:59 Berlin``."""
    words = until(when, timezone.now())
    clock = in_zone(when, zone)
    return _time(when, f"{words} · {clock}" if words else clock)


@register.simple_tag
def clock_in(when: datetime | None, zone: str) -> SafeString | str:
    """A moment by the clocks of an assignment's time zone: ``Sun 29 Nov, 23:59 Berlin``."""
    if when is None:
        return "–"
    return _time(when, in_zone(when, zone))


def _time(when: datetime, text: str) -> SafeString:
    return format_html('<time class="deadline" datetime="{}">{}</time>', when.isoformat(), text)


def in_zone(when: datetime, zone: str) -> str:
    """Seconds where they are not 0; the year if it is another; the zone's abbreviation in an hour that comes twice."""
    local = when.astimezone(ZoneInfo(zone))
    with timezone.override(local.tzinfo):
        clock = written(when, zone=False)
    seconds = f"{local::%S}" if local.second else ""
    place = zone.rpartition("/")[2].replace("_", " ")
    twice = local.replace(fold=1 - local.fold).utcoffset() != local.utcoffset()
    return f"{clock}{seconds} {place}{f' ({local:%Z})' if twice else ''}"


def until(when: datetime, now: datetime) -> str:
    """The time until a moment in its largest unit; ``""`` once it is over."""
    minutes = int((when.astimezone(UTC) - now).total_seconds() // 60)
    if when < now:
        return ""
    if minutes >= 2 * 24 * 60:
        return _("in %(count)s days") % {"count": minutes // (24 * 60)}
    if minutes >= 60:
        hours = minutes // 60
        return ngettext("in %(count)s hour", "in %(count)s hours", hours) % {"count": hours}
    return ngettext("in %(count)s minute", "in %(count)s minutes", minutes) % {"count": minutes}


@register.simple_tag(takes_context=True)
def tasks_due(context: template.Context) -> list[Any]:
    """What the reader can hand in now; nothing for guests."""
    user = context.get("user")
    return due_next(user, timezone.now()) if isinstance(user, Racer) else []


register.filter("in_zone", in_zone)
register.filter("pass_label", pass_rule_label)


@register.filter
def rule_sentence(part: AssignmentPart) -> str:
    """The rule for passing of a part, as a sentence."""
    return pass_rule_sentence(part.pass_rule, part.pass_params)


@register.filter
def race_words(part: AssignmentPart) -> str:
    """What is driven, in a line: race type, direction, laps, boxes or bots."""
    rules: RaceRules = part.race_rules
    words = [str(RaceType(rules.race_type).label), str(Direction(rules.direction).label)]
    words.append(ngettext("%(count)s lap", "%(count)s laps", rules.laps) % {"count": rules.laps})
    boxes = len(rules.boxes) + rules.random_boxes
    if boxes:
        words.append(ngettext("%(count)s box", "%(count)s boxes", boxes) % {"count": boxes})
    if rules.bots:
        words.append(ngettext("%(count)s bot", "%(count)s bots", rules.bots) % {"count": rules.bots})
    return " · ".join(words)


@register.filter
def counting_words(assignment: Assignment) -> str:
    """Which attempt counts, as a sentence."""
    if assignment.counts == Counts.FIRST_K and assignment.first_k == 1:
        return _("The first attempt counts.")
    if assignment.counts == Counts.FIRST_K:
        return _("The best of the first %(count)s attempts counts.") % {"count": assignment.first_k}
    return _("The last attempt counts.") if assignment.counts == Counts.LAST else _("The best attempt counts.")


@register.simple_tag
def group_address(group: RacerGroup) -> str:
    """The page of a class or a group."""
    return getattr(group, "classroom", group).get_absolute_url()


@register.simple_tag
def points_difference(old: str, new: str) -> str:
    """``+12.5``."""
    difference = Decimal(new) - Decimal(old)
    return f"{'+' if difference > 0 else '−'}{plain_points(abs(difference))}"


COLUMNS = {
    "name": (gettext_lazy("Student"), ""),
    "points": (gettext_lazy("Points"), "num"),
    "late": (gettext_lazy("Late days"), "num"),
    "attempts": (pgettext_lazy("of an assignment", "Attempts"), "num"),
    "state": (gettext_lazy("State"), ""),
}


@register.inclusion_tag("courses/marks/column.html", takes_context=True)
def mark_column(context: template.Context, name: str) -> dict[str, object]:
    """The heading of a column of marks, which sorts by it; again: the other way round."""
    label, kind = COLUMNS[name]
    here, backwards = context["sort"] == name, context["backwards"]
    highest_first = SORTS[name] != backwards
    return {
        "label": label,
        "kind": kind,
        "sorts": f"-{name}" if here and not backwards else name,
        "order": ("descending" if highest_first else "ascending") if here else "none",
    }


@register.simple_tag
def assignments_of_group(viewer: Any, group: RacerGroup) -> dict[str, object]:
    """The assignments of a group that the viewer sees, and whether the viewer teaches it."""
    found = assignments_visible_to(viewer).filter(group=group).order_by("due_at", "pk")
    return {"list": list(found), "teaches": can_teach_group(viewer, group), "is_class": hasattr(group, "classroom")}

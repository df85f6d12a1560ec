"""Notices for pages and the API."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db.models import Q, QuerySet
from django.utils.translation import gettext as _

from accounts.models import Racer
from core.database.kept_queries import KeptQuery
from evaluation.models import Evaluation
from races.models import Race
from races.spoilers.selectors import spoilers_of_racer
from races.web.names import named

from ..models import Cup, Notice, Season
from .kinds import KINDS

MOST_COUNTED = 100

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


def notices_of(racer: Racer | AnonymousUser) -> QuerySet[Notice]:
    """A racer's notices on the site, the latest first, without those that would show hidden results; none for
    guests."""
    if racer.pk is None:
        return Notice.objects.none()
    notices = Notice.objects.filter(racer_id=racer.pk, hidden=False)
    if racer.hides_results_since is None:
        return notices
    return notices.exclude(kind__in=_spoiling_kinds(), path__in=_hidden_paths(racer))


_unread_kinds = KeptQuery(
    lambda racer: (
        Notice.objects.filter(racer_id=racer, hidden=False, read_at=None)
        .order_by()
        .values_list("kind", flat=True)[:MOST_COUNTED]
    )
)


def count_unread(racer: Racer) -> int:
    """How many of :func:`notices_of` are unread, up to :data:`MOST_COUNTED`. One query, and more only if one of
    them may show hidden results."""
    kinds = _unread_kinds(racer=racer.pk)
    if racer.hides_results_since is None or not set(kinds).intersection(_spoiling_kinds()):
        return len(kinds)
    return notices_of(racer).filter(read_at=None).order_by()[:MOST_COUNTED].count()


def text_without_results(notice: Notice) -> str:
    """The text of a mail whose notice would show hidden results, in the active language; else ""."""
    racer = notice.racer
    if (
        racer.hides_results_since is None
        or notice.kind not in _spoiling_kinds()
        or notice.path not in _hidden_paths(racer)
    ):
        return ""
    name = notice.params.get("race") or notice.params.get("season") or ""
    if not name:
        return _("There is news about results that you hide.")
    return _("There is news of %(race)s, which you have not watched yet.") % {"race": named(name)}


def _hidden_paths(racer: Racer) -> set[str]:
    """Pages of hidden results to which notices lead: races, the racer's runs in them, their seasons and cups."""
    hidden = spoilers_of_racer(racer).hidden
    if not hidden:
        return set()
    races = Race.objects.filter(pk__in=hidden)
    paths = {race.get_absolute_url() for race in races}
    runs = Evaluation.objects.filter(owner=racer, submission__entry__race__in=hidden)
    paths |= {run.get_absolute_url() for run in runs.only("public_id")}
    for season in Season.objects.filter(rounds__race__in=hidden).distinct():
        page = season.get_absolute_url()
        paths |= {page, f"{page}finales/"}
    cups = Cup.objects.filter(Q(race__in=hidden) | Q(divisions__race__in=hidden)).distinct()
    return paths | {cup.get_absolute_url() for cup in cups}


def _spoiling_kinds() -> list[str]:
    return [kind for kind in KINDS.values() if kind.spoils]

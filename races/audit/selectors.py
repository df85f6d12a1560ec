"""Permissions to read entries of the audit log, and filters."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from datetime import date, datetime, time, timedelta

from django.db.models import F, Q, QuerySet
from django.utils import timezone

from accounts.models import Racer, Viewer
from core.audit.models import AuditEntry

from ..models import Race

PER_PAGE = 50
AT_ONCE = 500
PERMISSION = "core.view_auditentry"


def reads_all(viewer: Viewer) -> bool:
    """Whether the viewer may read the whole log: admins with the permission."""
    return isinstance(viewer, Racer) and viewer.is_staff and viewer.has_perm(PERMISSION)


def entries_visible_to(viewer: Viewer) -> QuerySet[AuditEntry]:
    """All entries that the viewer may read, the newest first: all for readers of the whole log, those of their races
    for organisers."""
    entries = AuditEntry.objects.select_related("actor", "racer").order_by("-pk")
    if reads_all(viewer):
        return entries
    if not isinstance(viewer, Racer):
        return entries.none()
    races = Race.objects.all() if viewer.is_staff else Race.objects.filter(organiser=viewer)
    return entries.filter(race__in=races.values("pk"))


@dataclass(frozen=True)
class AuditFilter:
    """``actor``: an alias, or ``#`` and an id; ``target``: a name, or ``kind:id``; ``since`` and ``until``: days of
    the site's zone, both included."""

    actor: str = ""
    action: str = ""
    target: str = ""
    since: date | None = None
    until: date | None = None

    def __call__(self, entries: QuerySet[AuditEntry]) -> QuerySet[AuditEntry]:
        found = Q()
        if self.actor:
            # by itself Django would join the racers, and leave out deleted ones
            entries = entries.alias(actor_number=F("actor_id"))
            found &= Q(actor_number=self._racer())
        if self.action:
            found &= Q(action=self.action)
        kind, colon, number = self.target.partition(":")
        if self.target:
            found &= Q(target_kind=kind, target_id=number) if colon else Q(target_name=self.target)
        if self.since:
            found &= Q(at__gte=_begin(self.since))
        if self.until:
            found &= Q(at__lt=_begin(self.until + timedelta(days=1)))
        return entries.filter(found)

    @property
    def asked(self) -> dict[str, object]:
        """The filled fields, for addresses."""
        return {one.name: value for one in fields(self) if (value := getattr(self, one.name))}

    def _racer(self) -> int:
        number = self.actor.removeprefix("#")
        if self.actor.startswith("#"):
            return int(number) if number.isascii() and number.isdigit() and len(number) < 18 else 0
        return Racer.objects.filter(alias__iexact=self.actor).values_list("pk", flat=True).first() or 0


@dataclass(frozen=True)
class AuditPage:
    """``older``: the id before which the next page begins; None on the last one. ``races``: the races' slugs by id."""

    entries: Sequence[AuditEntry]
    older: int | None
    races: dict[int, str] = field(default_factory=dict)


def page_of(entries: QuerySet[AuditEntry], *, before: int | None = None, size: int = PER_PAGE) -> AuditPage:
    """A page of entries older than ``before``: two queries, however long the log is."""
    older = entries if before is None else entries.filter(pk__lt=before)
    shown = list(older[: size + 1])
    more, shown = len(shown) > size, shown[:size]
    numbers = {entry.race for entry in shown if entry.race is not None}
    races = dict(Race.objects.filter(pk__in=numbers).values_list("pk", "slug")) if numbers else {}
    return AuditPage(shown, shown[-1].pk if more else None, races)


def in_order(entries: QuerySet[AuditEntry]) -> Iterator[AuditEntry]:
    """All of the entries, the oldest first, a few at a time."""
    last = 0
    while some := list(entries.filter(pk__gt=last).order_by("pk")[:AT_ONCE]):
        yield from some
        last = some[-1].pk


def _begin(day: date) -> datetime:
    return timezone.make_aware(datetime.combine(day, time()), timezone.get_default_timezone())

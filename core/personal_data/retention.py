"""How long data are kept: one policy for each kind, its setting in days, what is due, and its deletion."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from django.conf import settings
from django.db.models import QuerySet

Due = Callable[[datetime, datetime], QuerySet[Any]]


def _delete_rows(rows: QuerySet[Any], now: datetime) -> int:
    return rows.delete()[0]


def _no_files(rows: QuerySet[Any]) -> int:
    return 0


@dataclass(frozen=True)
class RetentionPolicy:
    """How long one kind of data is kept.

    ``setting``: the days, 0 for ever; ``due(before, now)``: the rows that go; ``delete``: deletes them and returns how
    many; ``weigh``: the bytes of their files."""

    name: str
    setting: str
    due: Due
    delete: Callable[[QuerySet[Any], datetime], int] = _delete_rows
    weigh: Callable[[QuerySet[Any]], int] = _no_files

    @property
    def days(self) -> int:
        return getattr(settings, self.setting)

    def rows(self, now: datetime) -> QuerySet[Any] | None:
        """What is due; None where this kind is kept for ever."""
        return self.due(now - timedelta(days=self.days), now) if self.days else None


@dataclass(frozen=True)
class Outdated:
    """What a policy deletes, or has deleted: rows, and bytes of files."""

    policy: RetentionPolicy
    rows: int
    size: int


def retain(policies: list[RetentionPolicy], *, now: datetime, dry_run: bool = False) -> list[Outdated]:
    """Apply the policies, or with ``dry_run`` only count what they would delete."""
    done = []
    for policy in policies:
        rows = policy.rows(now)
        count = 0 if rows is None else rows.count()
        size = policy.weigh(rows) if rows is not None and count else 0
        if rows is not None and count and not dry_run:
            policy.delete(rows, now)
        done.append(Outdated(policy, count, size))
    return done

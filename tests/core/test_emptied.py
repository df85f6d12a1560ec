"""After a test that commits, the database is as migrating left it (tests/emptied.py)."""

from __future__ import annotations

import pytest
from django.contrib.auth.models import Permission
from django.db import connection

from tests.emptied import Migrated
from tests.factories import a_race, a_racer, drive, laps


@pytest.mark.django_db(transaction=True)
def test_restoring_leaves_only_what_migrations_wrote(wakes, now):
    migrated = Migrated()
    before = list(Permission.objects.order_by("pk").values_list())
    drive(a_race(now), a_racer(), laps(10_000, 10_000, 10_000), now)
    Permission.objects.first().delete()
    Permission.objects.update(name="another")
    migrated.restore()
    assert list(Permission.objects.order_by("pk").values_list()) == before
    with connection.cursor() as cursor:
        tables = [name for name in connection.introspection.table_names(cursor) if name.startswith(OURS)]
        counts = {name: cursor.execute(f"SELECT COUNT(*) FROM {name}").fetchone()[0] for name in tables}
    assert tables and set(counts.values()) == {0}, counts


OURS = ("accounts_", "core_", "evaluation_", "league_", "races_", "tracks_", "training_", "videos_")

"""Telling racers and programs what happens looks at what is new, by an index, however much has happened before."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from accounts.models import Racer
from league.notices.services import send_mails
from league.webhooks.deliveries import deliver_due
from league.webhooks.services import add_webhook
from races.pages.services import cancel_race
from tests.factories import a_race, drive, laps
from tests.happened import queue_deliveries, tell_what_happened

pytestmark = pytest.mark.django_db

# Webhooks and seasons are few: a site adds a season or two a year.
WHOLE_TABLES = {"league_season", "league_webhook"}


def read_whole(call: Callable[[], object]) -> set[str]:
    """The tables of which a query of the call reads every row."""
    with CaptureQueriesContext(connection) as caught:
        call()
    found: set[str] = set()
    on_sqlite = connection.vendor == "sqlite"
    with connection.cursor() as cursor:
        if not on_sqlite:
            cursor.execute("SET LOCAL enable_seqscan = off")  # small tables are else read whole for good reason
        for query in caught.captured_queries:
            if not query["sql"].startswith(("SELECT", "UPDATE", "DELETE")):
                continue
            cursor.execute(f"EXPLAIN {'QUERY PLAN' if on_sqlite else ''} {query['sql'].replace('%', '%%')}")
            for *_ids, line in cursor.fetchall():
                words = line.split()
                if on_sqlite and words[0] == "SCAN" and "INDEX" not in words:
                    found.add(words[1])
                if "Seq" in words and "Scan" in words:
                    found.add(words[words.index("on") + 1])
    return found


def test_no_growing_table_is_read_in_full(wakes, alice, bob):
    now = timezone.now()
    race = a_race(now, organiser=alice)
    drive(race, bob, laps(10_000, 10_000, 10_000), now)
    cancel_race(race=a_race(now, organiser=alice), reason="Rain.", now=now)
    add_webhook(owner=Racer.objects.get(alias="alice"), url="https://example.org/told")

    def tell() -> None:
        tell_what_happened(now=now)
        send_mails(now=now)
        queue_deliveries(now=now)

    assert read_whole(tell) <= WHOLE_TABLES
    assert read_whole(lambda: deliver_due(now=now.replace(year=now.year - 1))) == set()


def test_queueing_returns_the_number_of_new_deliveries(wakes, alice, bob):
    add_webhook(owner=alice, url="https://example.org/told")
    now = timezone.now()
    drive(a_race(now, organiser=alice), bob, laps(10_000, 10_000, 10_000), now)
    later = timezone.now()
    assert queue_deliveries(now=later) == 1
    assert queue_deliveries(now=later) == 0 == queue_deliveries(now=timezone.now())

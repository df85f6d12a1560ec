"""The ranks at the start of the day (UTC), from which boards show the places gained since."""

from datetime import datetime, timedelta

from django.db import connection, transaction
from django.db.models import Q

from ..models import Entry, Race
from .selectors.board import CLASSIFIED, ORDER, board_entries

SHOWN_FOR = timedelta(days=1)  # after a race has closed


def note_ranks(*, now: datetime) -> int:
    """Write down the ranks in each open race, once a day, and forget those of races that are over. Returns how many
    races were written."""
    over = Q(closes_at__lte=now - SHOWN_FOR) | Q(cancelled_at__isnull=False)
    Race.objects.filter(over, day_of_ranks__isnull=False).update(day_of_ranks=None)
    races = Race.objects.filter(opens_at__lte=now, closes_at__gt=now, cancelled_at=None, imported_at=None)
    written = list(races.exclude(day_of_ranks=now.date()).values_list("pk", flat=True))
    for race in written:
        _note(race, now)
    return len(written)


@transaction.atomic
def _note(pk: int, now: datetime) -> None:
    race = Race.objects.select_for_update(no_key=True).only("pk").get(pk=pk)
    Entry.objects.filter(race=race, day_rank__isnull=False).update(day_rank=None)
    ranked = board_entries(race).filter(CLASSIFIED, is_baseline=False).order_by().values("pk")
    sql, params = ranked.query.sql_with_params()
    table = Entry._meta.db_table
    with connection.cursor() as cursor:
        cursor.execute(
            f"UPDATE {table} SET day_rank = ranked.place FROM (SELECT id, ROW_NUMBER() OVER "
            f"(ORDER BY {', '.join(ORDER[:-1])}, id) AS place FROM {table} WHERE id IN ({sql})) AS ranked "
            f"WHERE {table}.id = ranked.id",
            params,
        )
    Race.objects.filter(pk=pk).update(day_of_ranks=now.date())

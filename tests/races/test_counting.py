"""The counts of a board are those of its entries, whoever writes them and however."""

from __future__ import annotations

import random
from datetime import UTC, datetime, timedelta

import pytest
from django.db import connection, transaction
from django.db.models import F
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from races.boards.selectors.board import board, board_entries, rank_of, ranks_of, whole_board
from races.boards.selectors.counts import score_at, totals_of
from races.boards.triggers import install, rebuild
from races.entries.selectors.lists import racing_now
from races.entries.services.entries import restore_entry, withdraw
from races.models import BoardCount, Entry, Race
from races.models.counting import CLASSIFIED, EVERYBODY, SHIFTS, TOTAL
from races.ranks import MOST_DRIVEN, NOT_CLASSIFIED
from tests.factories import a_race, a_racer
from tests.soak import examples

pytestmark = pytest.mark.django_db
NOW = datetime(2026, 11, 15, 12, tzinfo=UTC)


def an_entry(race: Race, chance: random.Random, **fields) -> Entry:
    """An entry somewhere on the board: most classified, many with equal scores, some without any result."""
    kind = chance.random()
    entry = Entry(race=race, racer=a_racer())
    if kind < 0.7:
        score = chance.choice((1000, 1001, 1023, 1024, 1056, 2**15, 2**20 - 1, 2**27 + 5, chance.randrange(10**6)))
        entry.classified, entry.score_ms, entry.rank_score = True, score, score
        entry.best_lap_ms = entry.rank_lap = chance.choice((300, 301))
        entry.resets, entry.achieved_at = chance.randrange(2), NOW + timedelta(seconds=chance.randrange(3))
    elif kind < 0.85:
        entry.rank_score, entry.achieved_at = NOT_CLASSIFIED - chance.choice((0, 120, MOST_DRIVEN)), NOW
    for name, value in fields.items():
        setattr(entry, name, value)
    return entry


def counted(race: Race) -> dict[tuple[int, int], tuple[int, int]]:
    """What the counts of a race should be, from its entries one by one: all, and racers."""
    counts: dict[tuple[int, int], list[int]] = {}
    for entry in Entry.objects.filter(race=race, withdrawn_at=None):
        keys = [(shift, entry.rank_score >> shift) for shift in SHIFTS] + [(TOTAL, EVERYBODY)]
        for key in keys + [(TOTAL, CLASSIFIED)] * entry.classified:
            one = counts.setdefault(key, [0, 0])
            one[0] += 1
            one[1] += not entry.is_baseline
    return {key: (rows, racers) for key, (rows, racers) in counts.items()}


def stored(race: Race) -> dict[tuple[int, int], tuple[int, int]]:
    rows = BoardCount.objects.filter(race=race).exclude(rows=0, racers=0)
    return {(row.shift, row.bucket): (row.rows, row.racers) for row in rows}


def check(race: Race) -> None:
    """Counts, ranks and pages are those of a full sort."""
    assert stored(race) == counted(race)
    ordered = list(board_entries(race))
    ranked = [entry.pk for entry in ordered if entry.classified and not entry.is_baseline]
    ranks = {pk: rank for rank, pk in enumerate(ranked, start=1)}
    assert ranks_of(ordered) == {entry.pk: ranks.get(entry.pk) for entry in ordered}
    shown, page = [], 1
    while page == 1 or page <= board(race, per_page=3).pages:
        shown += [(row.entry.pk, row.rank) for row in board(race, per_page=3, page=page).rows]
        page += 1
    assert shown == [(entry.pk, ranks.get(entry.pk)) for entry in ordered]
    for position, entry in enumerate(ordered):
        score, before = score_at(race, position)
        assert score == entry.rank_score
        assert before == position - sum(one.rank_score < score for one in ordered)
    assert score_at(race, len(ordered)) is None


def some_operation(race: Race, other: Race, chance: random.Random) -> None:
    """Any way in which entries are written."""
    entries = list(race.entries.order_by("pk"))
    some = chance.sample(entries, min(len(entries), chance.randint(0, 4)))
    one = chance.choice(entries) if entries else None
    fresh = an_entry(race, chance)
    match chance.randrange(11):
        case 0 | 1 | 2:
            fresh.save()
        case 3:
            Entry.objects.bulk_create(
                [an_entry(race, chance, is_baseline=chance.random() < 0.3) for _ in range(5)], ignore_conflicts=True
            )
        case 4 if one is not None:
            _take_standing(one, fresh)
            one.save()
        case 5:
            for entry in some:
                _take_standing(entry, an_entry(race, chance))
            Entry.objects.bulk_update(some, _STANDING)
        case 6:
            Entry.objects.filter(pk__in=[entry.pk for entry in some]).update(withdrawn_at=NOW)
        case 7:
            Entry.objects.filter(pk__in=[entry.pk for entry in some]).update(withdrawn_at=None)
        case 8:
            Entry.objects.filter(pk__in=[entry.pk for entry in some]).update(is_baseline=~F("is_baseline"))
        case 9 if one is not None:
            one.delete()
        case 10 if one is not None:
            one.race = other
            one.save()
            Entry.objects.filter(pk=one.pk).update(race=race)


_STANDING = ("classified", "score_ms", "rank_score", "best_lap_ms", "rank_lap", "resets", "achieved_at")


def _take_standing(entry: Entry, other: Entry) -> None:
    for name in _STANDING:
        setattr(entry, name, getattr(other, name))


@settings(
    max_examples=examples(20 if connection.vendor == "sqlite" else 10),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(seed=st.integers(0, 2**32))
def test_ranks_and_pages_match_a_full_sort(db, seed):
    chance = random.Random(seed)
    with transaction.atomic():
        race, other = a_race(NOW), a_race(NOW)
        for _ in range(25):
            some_operation(race, other, chance)
        check(race)
        check(other)
        before = stored(race)
        rebuild()
        assert stored(race) == before
        transaction.set_rollback(True)


def test_leaving_and_returning_update_the_counts():
    race = a_race(NOW)
    entries = [an_entry(race, random.Random(1), is_baseline=False) for _ in range(3)]
    for entry in entries:
        entry.save()
    withdraw(entry=entries[0], now=NOW)
    assert totals_of(race).rows == 2 == board(race).count
    Entry.objects.filter(pk=entries[0].pk).update(removed_at=NOW)
    restore_entry(entry=entries[0], by=a_racer(is_staff=True))
    assert totals_of(race).racers == 3 == racing_now(NOW).get(pk=race.pk).entry_count
    check(race)


def test_deleting_a_race_deletes_its_counts():
    race = a_race(NOW)
    for seed in range(4):
        an_entry(race, random.Random(seed)).save()
    race.delete()
    assert not BoardCount.objects.exists()


def test_rolled_back_writes_are_not_counted():
    race = a_race(NOW)
    with transaction.atomic():
        an_entry(race, random.Random(1)).save()
        transaction.set_rollback(True)
    assert stored(race) == {}


def test_migrating_creates_the_triggers_once():
    assert install("default") is False


@pytest.mark.skipif(connection.vendor != "sqlite", reason="how SQLite loses them")
def test_dropped_triggers_are_restored_with_correct_counts():
    race = a_race(NOW)
    with connection.cursor() as cursor:
        cursor.execute("SELECT name FROM sqlite_master WHERE type = 'trigger' AND name LIKE 'races_board%'")
        for (name,) in cursor.fetchall():
            cursor.execute(f"DROP TRIGGER {name}")
    an_entry(race, random.Random(1)).save()
    assert stored(race) == {}
    assert install("default") is True
    assert stored(race) == counted(race)
    an_entry(race, random.Random(2)).save()
    check(race)


def test_a_long_board_needs_no_more_queries_for_page_or_rank(django_assert_num_queries):
    race = a_race(NOW)
    entries = Entry.objects.bulk_create([an_entry(race, random.Random(seed)) for seed in range(80)])
    mine = next(entry for entry in entries if entry.classified)
    with django_assert_num_queries(2):
        board(race, per_page=3)
    with django_assert_num_queries(5):
        board(race, per_page=3, page=13)
    with django_assert_num_queries(3):
        board(race, per_page=3, page=27)  # nobody with a rank
    with django_assert_num_queries(1):
        rank_of(mine)
    assert len(list(whole_board(race))) == 80


@pytest.mark.django_db(transaction=True)
def test_concurrent_results_are_all_counted():
    from tests.races.test_concurrency import at_once

    race = a_race(NOW)
    entries = [an_entry(race, random.Random(seed)) for seed in range(8)]
    for entry in entries:
        entry.save()

    def move(number: int):
        def call() -> None:
            chance = random.Random(100 + number)
            for _ in range(6):
                with transaction.atomic():
                    entry = Entry.objects.select_for_update().get(pk=entries[number].pk)
                    _take_standing(entry, an_entry(race, chance, racer=entry.racer))
                    entry.save()

        return call

    answers = at_once([move(number) for number in range(8)])
    assert answers == [None] * 8
    check(race)

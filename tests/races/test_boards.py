"""Boards: order, ranks, gaps, marks, pages, and that a page costs the same on any board."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import connection
from django.test.utils import CaptureQueriesContext

from accounts.models import Racer
from races.boards.selectors.board import board, board_entries, podiums, rank_of, whole_board
from races.entries.selectors.lists import (
    entry_of,
    organised_by,
    racer_history,
    races_in,
    races_of,
    races_on,
    racing_now,
    submissions_of,
)
from races.entries.selectors.visibility import races_visible_to
from races.entries.services.entries import enter_race, remove_entry, withdraw
from races.entries.services.submissions import submit_model
from races.models import Entry, Race
from races.ranks import NOT_CLASSIFIED
from tests.factories import a_model, a_race, a_racer, a_track, drive, lap, laps
from tests.rows import track_row

pytestmark = pytest.mark.django_db


def many_entries(race: Race, count: int, now, *, baselines: int = 0, unclassified: int = 0) -> list[Entry]:
    """Rows of entries with scores 10,000, 10,001, ... written at once."""
    names = [f"r{race.pk}-{number}" for number in range(count + baselines + unclassified)]
    racers = Racer.objects.bulk_create(Racer(alias=name, email=f"{name}@example.org") for name in names)
    entries = []
    for number, racer in enumerate(racers):
        if number < count + baselines:
            is_baseline = number >= count
            score = 10_000 + number if not is_baseline else 10_000 + 3 * (number - count) + 1
            standing = {"classified": True, "score_ms": score, "rank_score": score, "best_lap_ms": score}
            standing |= {"rank_lap": score, "achieved_at": now, "is_baseline": is_baseline}
        else:
            standing = {"rank_score": NOT_CLASSIFIED - number, "achieved_at": now}
        entries.append(Entry(race=race, racer=racer, **standing))
    return Entry.objects.bulk_create(entries)


def test_ties_are_broken_by_score_best_lap_resets_then_time(now):
    race = a_race(now)
    runs = {
        "slow": ((9_100, 9_100, 9_100), 0, 0),
        "late": ((9_000, 9_000, 9_000), 0, 5),
        "reset": ((9_000, 9_000, 9_000), 1, 0),
        "early": ((9_000, 9_000, 9_000), 0, 1),
        "peak": ((8_900, 9_000, 9_100), 3, 9),
    }
    for name, (times, resets, minute) in runs.items():
        drive(race, a_racer(name), laps(*times, resets=resets), now + timedelta(minutes=minute))
    rows = board(race).rows
    assert [(row.rank, row.alias, row.gap_ms) for row in rows] == [
        (1, "peak", 0),
        (2, "early", 0),
        (3, "late", 0),
        (4, "reset", 0),
        (5, "slow", 100),
    ]
    assert [rank_of(row.entry) for row in rows] == [1, 2, 3, 4, 5]


def test_classified_cars_come_first_and_undriven_ones_last(now):
    race = a_race(now)
    enter_race(race=race, racer=a_racer("idle"), now=now)
    drive(race, a_racer("near"), [lap(1, 9_000, complete=False, percentage=80)], now)
    drive(race, a_racer("far"), [lap(1, 90_000), lap(2, 1_000, complete=False, percentage=10)], now)
    drive(race, a_racer("slow"), laps(99_000, 99_000, 99_000), now)
    page = board(race)
    assert [(row.rank, row.alias, row.classified) for row in page.rows] == [
        (1, "slow", True),
        (None, "far", False),
        (None, "near", False),
        (None, "idle", False),
    ]
    assert (page.count, page.classified_count, page.leader_ms) == (4, 1, 99_000)
    assert [row.gap_ms for row in page.rows] == [0, None, None, None]
    assert rank_of(page.rows[1].entry) is None


def test_baselines_are_listed_in_place_without_a_rank(now):
    race = a_race(now)
    drive(race, a_racer("one"), laps(9_000, 9_000, 9_000), now)
    drive(race, a_racer("two"), laps(9_200, 9_200, 9_200), now)
    drive(race, a_racer("quick", is_house=True), laps(8_000, 8_000, 8_000), now)
    drive(race, a_racer("steady", is_house=True), laps(9_100, 9_100, 9_100), now)
    page = board(race)
    assert [(row.rank, row.alias, row.gap_ms, row.is_baseline) for row in page.rows] == [
        (None, "quick", -1_000, True),
        (1, "one", 0, False),
        (None, "steady", 100, True),
        (2, "two", 200, False),
    ]
    assert (page.count, page.classified_count, page.leader_ms) == (2, 2, 9_000)
    assert [rank_of(row.entry) for row in page.rows] == [None, 1, None, 2]


def test_a_board_with_only_baselines_has_no_leader(now):
    race = a_race(now)
    drive(race, a_racer("steady", is_house=True), laps(9_100, 9_100, 9_100), now)
    page = board(race)
    assert (page.leader_ms, page.count, len(page.rows), page.rows[0].gap_ms) == (None, 0, 1, None)


def test_an_empty_board_has_one_empty_page(now):
    page = board(a_race(now), page=7)
    assert (page.rows, page.page, page.pages, page.count, page.my_row, page.leader_ms) == ([], 1, 1, 0, None, None)


def test_sectors_are_purple_green_or_yellow(now):
    race = a_race(now, laps=2, minimum_laps=1, ranking_method="best")
    ann, ben = a_racer("ann"), a_racer("ben")
    drive(race, ann, [lap(1, 9_000, sectors=(3_000, 3_000, 3_000)), lap(2, 9_300, sectors=(2_900, 3_200, 3_200))], now)
    drive(race, ben, [lap(1, 9_400, sectors=(3_100, 3_100, 3_200)), lap(2, 9_500, sectors=(3_300, 3_200, 3_000))], now)
    drive(race, a_racer("house", is_house=True), [lap(1, 9_100, sectors=(1_000, 4_000, 4_100))], now)
    race.refresh_from_db()
    colours = {row.alias: row.sector_colours for row in board(race).rows}
    assert colours["ann"] == ("yellow", "purple", "purple"), "in sector 1 another lap of hers was faster"
    assert colours["ben"] == ("green", "green", "yellow")
    assert colours["house"] == ("green", "green", "green"), "a baseline marks and takes no purple"
    assert {row.alias: row.has_fastest_lap for row in board(race).rows} == {"ann": True, "ben": False, "house": False}


def test_an_entry_without_a_complete_lap_has_no_sector_marks(now):
    race = a_race(now)
    drive(race, a_racer("dnf"), [lap(1, 9_000, complete=False, percentage=50)], now)
    assert board(race).rows[0].sector_colours == (None, None, None)


def test_my_row_is_marked_and_found_on_any_page(now):
    race = a_race(now)
    entries = many_entries(race, 12, now, baselines=2)
    me = entries[10].racer
    page = board(race, me, page=1, per_page=5)
    assert page.my_row is not None and page.my_row.rank == 11 and page.my_row_is_elsewhere
    assert not any(row.is_me for row in page.rows)
    page = board(race, me, page=3, per_page=5)
    assert not page.my_row_is_elsewhere
    assert [row.rank for row in page.rows if row.is_me] == [11]
    assert board(race, AnonymousUser()).my_row is None
    assert board(race, a_racer("stranger")).my_row is None


def test_ranks_continue_across_pages_past_baselines(now):
    race = a_race(now)
    many_entries(race, 20, now, baselines=3, unclassified=4)
    ranks, seen = [], []
    for number in range(1, 6):
        page = board(race, page=number, per_page=6)
        assert (page.pages, page.page, page.count, page.classified_count) == (5, number, 24, 20)
        ranks += [row.rank for row in page.rows]
        seen += [row.entry.pk for row in page.rows]
    assert [rank for rank in ranks if rank is not None] == list(range(1, 21))
    assert len(seen) == len(set(seen)) == 27
    assert ranks == [row.rank for row in whole_board(race)]
    assert board(race, page=99, per_page=6).page == 5 and board(race, page=-1, per_page=6).page == 1


def test_withdrawn_and_removed_racers_are_not_on_the_board(now):
    organiser = a_racer("organiser")
    race = a_race(now, organiser=organiser)
    for name in ("stays", "leaves", "removed"):
        drive(race, a_racer(name), laps(9_000, 9_000, 9_000), now)
    withdraw(entry=Entry.objects.get(racer__alias="leaves"), now=now)
    remove_entry(entry=Entry.objects.get(racer__alias="removed"), by=organiser, now=now)
    page = board(race, Entry.objects.get(racer__alias="leaves").racer)
    assert [row.alias for row in page.rows] == ["stays"]
    assert page.my_row is None
    assert rank_of(Entry.objects.get(racer__alias="leaves")) is None


@pytest.mark.parametrize("count", [3, 120])
def test_a_board_page_needs_at_most_six_queries(now, count):
    race = a_race(now)
    entries = many_entries(race, count, now, baselines=3, unclassified=2)
    me = entries[count - 1].racer
    with CaptureQueriesContext(connection) as queries:
        page = board(race, me, page=1, per_page=50)
        for row in page.rows:
            assert row.alias and row.racer.country == "" and row.entry.race.name
        assert page.my_row is not None
    assert len(queries) <= 6, [query["sql"] for query in queries]


def test_the_board_reads_its_index_in_order_without_sorting(now):
    race = a_race(now)
    many_entries(race, 1500, now)
    many_entries(a_race(now), 1500, now)
    with connection.cursor() as cursor:
        cursor.execute("ANALYZE")
    page = board_entries(race)[:10]
    from_a_score_on = board_entries(race).filter(rank_score__gte=page[9].rank_score)[3:13]
    for queryset in (page, from_a_score_on):
        plan = queryset.explain()
        assert "entry_board" in plan, plan
        assert "TEMP B-TREE" not in plan and "Sort" not in plan, plan


def test_podiums_of_all_races_need_two_queries(now):
    races = [a_race(now) for _ in range(4)]
    many_entries(races[0], 5, now, baselines=2)
    many_entries(races[1], 2, now, unclassified=3)
    many_entries(races[2], 0, now, baselines=1)
    with CaptureQueriesContext(connection) as queries:
        found = podiums(races)
        shown = {
            pk: [(row.rank, row.entry.score_ms, row.gap_ms, row.alias) for row in rows] for pk, rows in found.items()
        }
    assert len(queries) == 2
    assert [place[:3] for place in shown[races[0].pk]] == [(1, 10_000, 0), (2, 10_001, 1), (3, 10_002, 2)]
    assert [place[0] for place in shown[races[1].pk]] == [1, 2]
    assert shown[races[2].pk] == shown[races[3].pk] == []


def test_no_races_have_no_podiums(db):
    assert podiums([]) == {}


def test_races_are_listed_by_time(alice, now):
    day = timedelta(days=1)
    later = a_race(now, opens_at=now + 2 * day, closes_at=now + 3 * day)
    soon = a_race(now, opens_at=now + day, closes_at=now + 9 * day)
    long = a_race(now, closes_at=now + 9 * day)
    short = a_race(now, closes_at=now + day)
    league = a_race(now, kind="league", division="open", closes_at=now + 20 * day)
    over = a_race(now, opens_at=now - 2 * day, closes_at=now)
    a_race(now, cancelled_at=now, cancel_reason="Rain.")
    secret = a_race(now, organiser=alice, visibility="invitation")
    assert list(racing_now(now)) == [league, short, long]
    assert list(racing_now(now, alice)) == [league, short, secret, long]
    assert list(races_in("upcoming", now)) == [soon, later]
    assert list(races_in("closed", now)) == [over]
    assert list(organised_by(alice, races_visible_to(alice))) == [secret]
    assert list(organised_by(alice, races_visible_to(None))) == []


def test_a_track_lists_open_races_first_and_finished_ones_last(now, alice):
    track, day = a_track(), timedelta(days=1)
    gone = a_race(now, track=track, opens_at=now - 5 * day, closes_at=now - 4 * day)
    just_over = a_race(now, track=track, opens_at=now - 9 * day, closes_at=now - day)
    cancelled = a_race(now, track=track, cancelled_at=now, cancel_reason="rain")
    year = a_race(now, track=track, closes_at=now + 300 * day)
    week = a_race(now, track=track, closes_at=now + 7 * day)
    later = a_race(now, track=track, opens_at=now + 40 * day, closes_at=now + 41 * day)
    next_up = a_race(now, track=track, opens_at=now + 2 * day, closes_at=now + 400 * day)
    secret = a_race(now, track=track, visibility="invitation", organiser=alice, closes_at=now + day)
    a_race(now, track=track_row("cosmic-loop"))
    assert list(races_on(track, now)) == [week, year, next_up, later, just_over, gone, cancelled]
    assert next(iter(races_on(track, now, alice))) == secret


def test_race_lists_count_the_racers_of_each_race(now):
    race, empty = a_race(now), a_race(now)
    entries = many_entries(race, 3, now, baselines=2)
    withdraw(entry=entries[0], now=now)
    counts = {each.pk: each.entry_count for each in racing_now(now)}
    assert counts == {race.pk: 2, empty.pk: 0}


def test_a_racer_has_lists_of_their_own_races(alice, bob, now):
    race, other = a_race(now), a_race(now)
    submission = drive(race, alice, laps(9_000, 9_000, 9_000), now)
    drive(race, bob, laps(8_000, 8_000, 8_000), now)
    enter_race(race=other, racer=alice, now=now)
    withdraw(entry=Entry.objects.get(race=other), now=now)
    assert list(races_of(alice)) == [race]
    assert entry_of(race, alice) == submission.entry
    assert entry_of(other, alice).is_withdrawn
    assert entry_of(race, AnonymousUser()) is None is entry_of(race, None)
    history = racer_history(alice, races_visible_to(None))
    assert [(row.race, row.rank) for row in history] == [(race, 2)]


def test_only_members_see_a_private_race_in_a_racers_history(alice, bob, now):
    race = a_race(now, organiser=bob, visibility="invitation")
    drive(race, bob, laps(8_000, 8_000, 8_000), now)
    assert racer_history(bob, races_visible_to(alice)) == [] == racer_history(bob, races_visible_to(None))
    assert len(racer_history(bob, races_visible_to(bob))) == 1


def test_submissions_are_listed_with_their_standing(alice, now):
    race = a_race(now)
    best = drive(race, alice, laps(9_000, 9_000, 9_000), now)
    drive(race, alice, laps(9_500, 9_500, 9_500), now)
    submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    entry = Entry.objects.get()
    with CaptureQueriesContext(connection) as queries:
        rows = submissions_of(entry)
    assert len(queries) <= 2
    assert [row.submission.number for row in rows] == [3, 2, 1]
    assert [row.standing.score_ms if row.standing else None for row in rows] == [None, 9_500, 9_000]
    assert [row.is_best for row in rows] == [False, False, True] and rows[2].submission == best

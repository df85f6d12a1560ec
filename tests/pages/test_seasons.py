"""Seasons on the site: shown to everybody, with feeds."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from xml.etree import ElementTree

import pytest
from django.test import Client
from django.urls import reverse
from icalendar import Calendar

from accounts.models import Racer
from core.database.commit_cache import Unchanged
from core.streams import shared_pieces
from league.models import DuelRating, Round, RoundPoints, Season, Stage
from league.seasons.services.demo_season import open_demo_season
from league.stewarding.official_results import close_due_rounds, close_round
from league.stewarding.services import disqualify
from tests.clients import logged_in
from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.kept import Kept
from tests.league.seasons import HOUR, JANUARY, a_round, a_season, after, board, racers
from tests.pages.test_pages import INLINE
from tests.pages.test_queries import FEW, LIMIT, queries

pytestmark = pytest.mark.django_db


@pytest.fixture(scope="session")
def kept_season_with_results(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, _make_season)


@pytest.fixture
def season(kept_season_with_results: Kept, db: None) -> Season:
    return kept_season_with_results.copy()


def _make_season() -> Season:
    """January's open race is official and promoted four of twenty; its pro race is open with three on the board."""
    made = a_season(drop_worst=1, prizes="A mug")
    first, pro = a_round(made, 1, Stage.OPEN), a_round(made, 2, Stage.PRO)
    a_round(made, 2, Stage.OPEN)
    a_round(made, 2, Stage.FINALE)
    field = racers(20)
    Racer.objects.filter(pk=field[0].pk).update(country="KR", team="Seoul Racing")
    board(first.race, field)
    close_round(round=first, now=after(first))
    board(pro.race, field[:3], first_ms=20_000)
    return made


PAGES = (
    "/seasons/",
    "/seasons/2027/",
    "/seasons/2027/standings/",
    "/seasons/2027/standings/?division=open",
    "/seasons/2027/standings/?division=open&of=countries",
    "/seasons/2027/standings/?division=open&of=teams",
    "/seasons/2027/standings/?division=nonsense&of=nonsense&page=nonsense",
    "/seasons/2027/finales/",
    "/seasons/2027/calendar/",
    "/seasons/2027/calendar/?zone=nonsense",
    "/seasons/2027/rules/",
    "/hall-of-fame/",
)


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_season_page_is_public(season, set_clock, language):
    """To each kind of reader in English; in Korean to a guest and to a racer of the season."""
    set_clock(JANUARY + timedelta(days=45))
    first = Round.objects.get(number=1).race.entries.first().racer
    admin = a_racer("boss", is_staff=True, is_superuser=True)
    readers = [Client(), logged_in(first), logged_in(a_racer()), logged_in(admin)]
    for client in readers if language == "en" else readers[:2]:
        client.cookies["django_language"] = language
        for path in (*PAGES, f"/seasons/2027/racers/{first.alias}/"):
            answer = client.get(path)
            assert answer.status_code == 200, path
            html = answer.content.decode()
            assert not INLINE.search(html), path
            assert f'<html lang="{language}"' in html
            assert len(queries(client, path)) <= FEW, path


def test_season_pages_need_no_more_queries_for_more_rows(season, set_clock):
    set_clock(JANUARY + timedelta(days=45))
    reader = Round.objects.get(number=1).race.entries.first().racer
    paths = (*PAGES, f"/seasons/2027/racers/{reader.alias}/", "/seasons/2027/standings/?division=open&page=2")
    client, first = logged_in(reader), Round.objects.get(number=1)
    before = {path: len(queries(client, path)) for path in paths}
    for number in range(3, 6):
        board(a_round(season, number, Stage.OPEN).race, [reader, *racers(60)])
    RoundPoints.objects.bulk_create(
        RoundPoints(round=first, racer=racer, rank=100 + place, points=1, country="KR")
        for place, racer in enumerate(racers(60))
    )
    DuelRating.objects.bulk_create(
        DuelRating(season=season, racer=racer, mu=25, sigma=8, duels=1) for racer in (reader, *racers(9))
    )
    assert {path: len(queries(client, path)) for path in paths} == before


def test_each_racer_finds_their_own_row_in_a_table_drawn_once(season, set_clock, monkeypatch):
    set_clock(JANUARY + timedelta(days=45))
    pro = Round.objects.get(stage=Stage.PRO)
    field = [one.racer for one in pro.race.entries.order_by("rank_score")]
    DuelRating.objects.bulk_create(DuelRating(season=season, racer=one, mu=25, sigma=8, duels=1) for one in field)
    monkeypatch.setattr(shared_pieces, "is_shared", lambda: True)
    monkeypatch.setattr(shared_pieces, "LIVES_S", 3600.0)
    monkeypatch.setattr(shared_pieces, "_parts", Unchanged(400))
    mine = re.compile(r'<(?:tr|li)[^>]* class="[^"]*\bme".*?/racers/([\w-]+)/"', re.DOTALL)
    for path, times in (
        ("/seasons/2027/", 3),
        ("/seasons/2027/standings/?division=open", 1),
        ("/seasons/2027/finales/", 1),
    ):
        for reader in (field[0], field[1], field[0]):
            html = logged_in(reader).get(path).content.decode()
            assert mine.findall(html) == [reader.alias] * times, path
        for client in (Client(), logged_in(a_racer())):
            html = client.get(path).content.decode()
            assert mine.findall(html) == [] and field[0].alias in html, path


def test_rounds_of_a_season_show_their_race_type():
    shown = open_demo_season(now=datetime(2026, 11, 21, tzinfo=UTC))
    html = Client().get(f"/seasons/{shown.slug}/").content.decode()
    for race_type in ("time trial", "object avoidance", "head-to-head"):
        assert html.count(f'title="{race_type}"') == 12 + (race_type == "head-to-head")


def test_unknown_seasons_and_racers_are_not_found(season):
    for path in ("/seasons/1999/", "/seasons/2027/racers/nobody/", "/seasons/1999/calendar.ics"):
        assert Client().get(path).status_code == 404


def test_the_board_draws_the_promotion_line(season, set_clock):
    second = Round.objects.get(number=2, stage=Stage.OPEN)
    set_clock(second.race.opens_at + timedelta(days=3))
    board(second.race, racers(10))
    address = second.race.get_absolute_url()
    html = Client().get(address).content.decode()
    rows = html.split("<tr ")
    line = next(index for index, row in enumerate(rows) if "would be promoted" in row)
    assert sum("linked" in row for row in rows[:line]) == 2, "a fifth of ten"
    assert "moves on" not in html and "would move on" in html
    set_clock(after(second))
    close_due_rounds(now=after(second))
    html = Client().get(address).content.decode()
    assert "↑ promoted to the pro division" in html and "would be promoted" not in html
    assert html.count("moves on") == 2


def test_a_pro_race_shows_its_line_and_the_provisional_field(season, set_clock):
    pro = Round.objects.get(stage=Stage.PRO)
    set_clock(pro.race.opens_at + timedelta(days=3))
    assert "would be in the finale" in Client().get(pro.race.get_absolute_url()).content.decode()
    page = Client().get("/seasons/2027/finales/")
    assert "provisional" in page.content.decode()
    assert len(page.context["fields"].next[0].finale.places) == 3
    set_clock(after(pro))
    close_due_rounds(now=after(pro))
    assert page.context["fields"].next[0].finale.official is False
    assert Client().get("/seasons/2027/finales/").context["fields"].next[0].finale.official is True


def test_a_long_season_board_needs_few_queries(season, set_clock):
    second = Round.objects.get(number=2, stage=Stage.OPEN)
    set_clock(second.race.opens_at + timedelta(days=3))
    entries = board(second.race, racers(5))
    client = logged_in(entries[0].racer)
    few = len(queries(client, second.race.get_absolute_url()))
    board(second.race, racers(60), first_ms=50_000)
    assert len(queries(client, second.race.get_absolute_url())) <= few
    assert few <= LIMIT


@pytest.mark.parametrize("stage", [Stage.PRO, Stage.FINALE])
def test_a_board_of_a_race_with_a_field_needs_few_queries(set_clock, stage):
    season = a_season()
    opened, pro = a_round(season, 1, Stage.OPEN), a_round(season, 2, Stage.PRO)
    finale = a_round(season, 2, Stage.FINALE)
    field = racers(20)
    board(opened.race, field)
    close_round(round=opened, now=after(opened))
    board(pro.race, field[:4], first_ms=20_000)
    if stage == Stage.FINALE:
        close_round(round=pro, now=after(pro))
        board(finale.race, field[:3], first_ms=60_000)
    race = {Stage.PRO: pro, Stage.FINALE: finale}[stage].race
    set_clock(race.opens_at + HOUR)
    sent = queries(logged_in(field[0]), race.get_absolute_url())
    assert len(sent) <= LIMIT, "\n".join(sent)


def test_a_middle_page_of_a_long_board_needs_few_queries(season, set_clock):
    second = Round.objects.get(number=2, stage=Stage.OPEN)
    set_clock(second.race.opens_at + timedelta(days=3))
    entries = board(second.race, racers(220))
    for reader in (a_racer(), entries[0].racer):
        sent = queries(logged_in(reader), f"{second.race.get_absolute_url()}?page=3")
        assert len(sent) <= LIMIT, "\n".join(sent)


def test_a_ranked_racer_costs_few_queries_on_any_board_page(season, set_clock):
    second = Round.objects.get(number=2, stage=Stage.OPEN)
    set_clock(now := second.race.opens_at + timedelta(days=3))
    board(second.race, racers(220))
    reader = a_racer()
    a_model(reader)
    drive(second.race, reader, laps(9_000, 9_100, 9_200), now)
    for page in (1, 3, 99):
        sent = queries(logged_in(reader), f"{second.race.get_absolute_url()}?page={page}")
        assert len(sent) <= LIMIT, "\n".join([f"page {page}", *sent])


def test_standings_show_rounds_dropped_results_countries_and_teams(season, set_clock):
    first = Round.objects.get(number=1)
    set_clock(after(first))
    page = Client().get("/seasons/2027/standings/?division=open")
    table = page.context["table"]
    assert [row.points for row in table.rows] == [10, 6, 3, 1]
    assert "Seoul Racing" in Client().get("/seasons/2027/standings/?division=open&of=teams").content.decode()
    assert "KR" in Client().get("/seasons/2027/standings/?division=open&of=countries").content.decode()


def test_a_racers_season_shows_every_round_a_chart_and_outcomes(season, set_clock):
    first = Round.objects.get(number=1)
    racer = first.race.entries.order_by("rank_score").first().racer
    set_clock(after(first))
    html = Client().get(f"/seasons/2027/racers/{racer.alias}/").content.decode()
    assert 'class="progress-chart"' in html and "promoted" in html and "pro division" in html
    assert Client().get(f"/seasons/2027/racers/{racer.alias.upper()}/").status_code == 301


def test_the_hall_of_fame_waits_until_the_season_is_over(season, set_clock):
    set_clock(after(Round.objects.get(number=1)))
    html = Client().get("/hall-of-fame/").content.decode()
    assert "Leading the standings" in html and "First in the standings" not in html
    set_clock(datetime(2028, 1, 2, tzinfo=UTC))
    html = Client().get("/hall-of-fame/").content.decode()
    assert "First in the standings" in html and "Leading the standings" not in html


def test_a_racer_sees_how_far_the_promotion_line_is(season, set_clock):
    second = Round.objects.get(number=2, stage=Stage.OPEN)
    set_clock(second.race.opens_at + timedelta(days=3))
    entries = board(second.race, racers(10))
    address = second.race.get_absolute_url()
    for place, words in (
        (0, "1 place clear"),
        (1, "in the zone"),
        (2, "1 place short"),
        (9, "8 places short"),
    ):
        assert words in logged_in(entries[place].racer).get(address).content.decode(), place
    close_due_rounds(now=after(second))
    set_clock(after(second))
    assert "1 place clear" not in logged_in(entries[0].racer).get(address).content.decode()


class TestCalendar:
    def test_times_are_shown_in_the_requested_time_zone(self, season, set_clock):
        set_clock(JANUARY)
        html = Client().get("/seasons/2027/calendar/?zone=Asia/Seoul").content.decode()
        assert "Fri 1 Jan, 09:00 KST" in html and "Times in Asia/Seoul." in html
        assert "Fri 1 Jan, 00:00 UTC" in Client().get("/seasons/2027/calendar/").content.decode()

    def test_the_file_is_icalendar_and_keeps_the_uid_of_a_postponed_race(self, season):
        answer = Client().get("/seasons/2027/calendar.ics")
        assert answer["Content-Type"].startswith("text/calendar")
        calendar = Calendar.from_ical(answer.content)
        events = list(calendar.walk("VEVENT"))
        assert len(events) == 4 and calendar["x-wr-calname"] == "2027"
        first = Round.objects.get(number=1).race
        assert events[0].decoded("dtstart") == first.opens_at and events[0].decoded("dtend") == first.closes_at
        first.closes_at += timedelta(days=1)
        first.save()
        moved = next(iter(Calendar.from_ical(Client().get("/seasons/2027/calendar.ics").content).walk("VEVENT")))
        assert moved["uid"] == events[0]["uid"] and moved.decoded("dtend") == first.closes_at
        assert all(len(line) <= 75 for line in answer.content.split(b"\r\n"))

    def test_a_cancelled_race_is_marked_cancelled(self, season):
        race = Round.objects.get(number=1).race
        type(race).objects.filter(pk=race.pk).update(cancelled_at=JANUARY, cancel_reason="It rained.")
        text = Client().get("/seasons/2027/calendar.ics").content.decode()
        assert "STATUS:CANCELLED" in text and "It rained." in text


def test_the_rules_are_generated_from_the_settings(season):
    html = Client().get("/seasons/2027/rules/").content.decode()
    for words in (
        "best 20 %",
        "best 3 racers",
        "best 2 of a finale",
        "10, 6, 3, 1",
        "The worst result is dropped",
        "A mug",
    ):
        assert words.casefold() in html.casefold(), words


def test_recorded_racers_have_a_page_and_deactivated_ones_none():
    Racer.objects.create(alias="from-a-record", email="x@record.invalid", is_active=False, record_id="abc")
    Racer.objects.create(alias="gone", email="gone@example.org", is_active=False)
    assert Client().get("/racers/from-a-record/").status_code == 200
    assert Client().get("/racers/gone/").status_code == 404


def test_the_league_opens_at_the_current_season(season, set_clock):
    set_clock(JANUARY)
    assert Client().get(reverse("season_now"))["Location"] == "/seasons/2027/"
    assert Client().get("/").status_code == 200


def test_a_community_race_has_no_promotion_line(set_clock):
    now = datetime(2027, 1, 15, tzinfo=UTC)
    set_clock(now)
    race = a_race(now)
    board(race, racers(5))
    html = Client().get(race.get_absolute_url()).content.decode()
    assert "promoted" not in html


def test_stewards_decisions_and_reasons_are_public(season, set_clock):
    first = Round.objects.get(number=1)
    loser = first.race.entries.order_by("rank_score").first().racer
    set_clock(after(first, hours=2))
    assert "Corrections possible until" in Client().get(first.race.get_absolute_url()).content.decode()
    steward = a_racer(is_staff=True)
    disqualify(round=first, racer=loser, by=steward, reason="Two accounts", now=after(first, hours=2))
    html = Client().get(first.race.get_absolute_url()).content.decode()
    assert "Two accounts" in html and loser.alias in html.split('id="stewards"')[1]
    set_clock(after(first, days=9))
    assert "Final since" in Client().get(first.race.get_absolute_url()).content.decode()


class TestFeeds:
    def test_a_team_name_is_neither_a_formula_nor_html(self, season, set_clock):
        first = Round.objects.get(number=1)
        set_clock(after(first))
        teams = dict(
            zip(first.points.order_by("rank").values_list("pk", flat=True), ("=1+1", "<b>B</b>"), strict=False)
        )
        for pk, team in teams.items():
            first.points.filter(pk=pk).update(team=team)
        lines = Client().get("/seasons/2027/standings.csv").content.decode().splitlines()
        assert "open,teams,1,'=1+1,,10,10" in lines and "open,teams,2,<b>B</b>,,6,6" in lines
        html = Client().get("/seasons/2027/standings/?division=open&of=teams").content.decode()
        assert "&lt;b&gt;B&lt;/b&gt;" in html and "<b>B</b>" not in html
        ElementTree.fromstring(Client().get("/seasons/2027/standings.atom").content)

    def test_a_public_board_has_a_feed_without_a_log_in(self, set_clock):
        now = datetime(2027, 1, 15, tzinfo=UTC)
        set_clock(now)
        race = a_race(now, name="Night & day")
        entries = board(race, racers(3))
        base = race.get_absolute_url()
        for name, kind in (
            ("board.json", "application/json"),
            ("board.csv", "text/csv"),
            ("board.atom", "application/atom"),
        ):
            answer = Client().get(base + name)
            assert answer.status_code == 200 and answer["Content-Type"].startswith(kind)
        feed = ElementTree.fromstring(Client().get(f"{base}board.atom").content)
        titles = [one.text for one in feed.iter("{http://www.w3.org/2005/Atom}title")]
        assert titles[1:] == [f"{n}. {e.racer.alias}, 0:{29 + n}.000" for n, e in enumerate(entries, 1)]
        ids = [one.text for one in feed.iter("{http://www.w3.org/2005/Atom}id")]
        assert len(set(ids)) == 4
        assert "board.atom" in Client().get(base).content.decode()

    def test_a_badge_names_the_leader_or_a_racer_and_escapes_both(self, set_clock):
        now = datetime(2027, 1, 15, tzinfo=UTC)
        set_clock(now)
        race = a_race(now, name='<b>"Night" & day')
        address = f"{race.get_absolute_url()}badge.svg"
        assert "no racer classified" in Client().get(address).content.decode()
        entries = board(race, racers(3))
        answer = Client().get(address)
        assert answer["Content-Type"] == "image/svg+xml" and answer["Cache-Control"] == "public, max-age=60"
        image = ElementTree.fromstring(answer.content)
        assert f"{entries[0].racer.alias} 0:30.000" in "".join(image.itertext())
        third = Client().get(address, {"racer": entries[2].racer.alias.upper()}).content.decode()
        assert "place 3, 0:32.000" in third
        assert "no racer classified" in Client().get(address, {"racer": "nobody"}).content.decode()

    def test_a_private_race_has_no_feed_for_strangers(self, set_clock):
        now = datetime(2027, 1, 15, tzinfo=UTC)
        set_clock(now)
        organiser = a_racer()
        race = a_race(now, visibility="invitation", organiser=organiser)
        for name in ("board.atom", "badge.svg"):
            assert Client().get(race.get_absolute_url() + name).status_code == 404
            answer = logged_in(organiser).get(race.get_absolute_url() + name)
            assert answer.status_code == 200 and answer["Cache-Control"] == "private, no-store"

    def test_standings_have_a_feed(self, season, set_clock):
        set_clock(after(Round.objects.get(number=1)))
        data = Client().get("/seasons/2027/standings.json").json()
        first = data["standings"][0]
        assert (first["division"], first["of"], first["place"], first["points"]) == ("open", "racers", 1, 10)
        assert first["rounds"][0]["rank"] == 1
        lines = Client().get("/seasons/2027/standings.csv").content.decode().splitlines()
        assert lines[0] == "division,of,place,name,country,points,rounds" and lines[1].endswith(",KR,10,10")
        feed = ElementTree.fromstring(Client().get("/seasons/2027/standings.atom").content)
        assert len(list(feed.iter("{http://www.w3.org/2005/Atom}entry"))) == 4
        assert Client().get("/seasons/2027/standings.xml").status_code == 404

"""The pages of a race of duels: qualifying, the draw, table or bracket, heats, and who may see and do what."""

from __future__ import annotations

import re
from datetime import datetime, timedelta

import pytest
from django.db import transaction
from django.utils import timezone

from accounts.models import Racer
from races.duels.services import draw_duels, drive_on
from races.entries.services.entries import accept_invitation
from races.models import Draw, Duel, Entry, Visibility
from tests.duels import a_duel_race, drawn, driving, end, end_all, qualify
from tests.factories import a_race, a_racer
from tests.pages.test_queries import LIMIT, queries

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _commits(monkeypatch):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


@pytest.fixture
def now() -> datetime:
    return timezone.now() - timedelta(days=1)


def page(client, race, racer: Racer | None = None, path: str = "duels/") -> str:
    if racer is not None:
        client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    response = client.get(f"/races/{race.slug}/{path}")
    assert response.status_code == 200
    return response.content.decode()


def seeded(race, seed: int) -> Racer:
    return Entry.objects.get(race=race, seed=seed).racer


def test_the_page_of_an_open_race_explains_how_duels_will_run(client, now):
    race = a_duel_race(timezone.now())
    html = page(client, race)
    assert "each car qualifies alone" in html and "Draw now" not in html


def test_only_a_race_with_duels_has_the_page_and_its_tab(client, now):
    race = a_race(now)
    assert client.get(f"/races/{race.slug}/duels/").status_code == 404
    assert "duels/" not in page(client, race, path="")
    assert "/duels/" in page(client, a_duel_race(now), path="")


def test_the_cross_table_shows_who_was_ahead_and_links_each_run(client, now):
    race = drawn(now, 3)
    (duel,) = driving(race)
    end(duel, now)
    html = page(client, race)
    assert html.count(f'href="/evaluations/{duel.evaluation.public_id}/"') == 3, "once in each row, once in the list"
    rows = re.findall(r"<tr class=.*?</tr>", html, re.S)
    ahead = [row for row in rows if "finished ahead" in row]
    behind = [row for row in rows if ">0<span" in row]
    assert (len(rows), len(ahead), len(behind)) == (3, 1, 1)
    assert "1 of 6 heats" in html


def test_the_bracket_shows_rounds_byes_and_who_advances(client, now):
    race = drawn(now, 3, duel_format="bracket")
    html = page(client, race)
    assert "Semi-finals" in html and "Final" in html and "bye" in html
    end_all(race, now, choose=max)
    html = page(client, race)
    won = re.findall(r'class="tree-car won.*?>(car-\d)<', html, re.S)
    assert won == ["car-1", "car-3", "car-3"] and "all decided" in html


def test_my_next_duel_shows_where_i_start(client, now):
    race = drawn(now, 2)
    html = page(client, race, seeded(race, 2))
    assert "My next duel" in html
    assert "My next duel" not in page(client, race, a_racer("stranger"))


def test_a_walkover_is_named_and_has_no_link(client, now, alice):
    from races.entries.services.entries import remove_entry

    race = drawn(now, 2, organiser=alice)
    remove_entry(entry=Entry.objects.get(race=race, seed=2), by=alice, now=now)
    html = page(client, race)
    assert html.count("walkover") >= 2 and "did not start" in html


def test_the_cross_table_names_racers_who_left(client, now, alice):
    from races.entries.services.entries import remove_entry

    race = drawn(now, 3, organiser=alice)
    assert "No longer in the race" not in page(client, race)
    end_all(race, now)
    remove_entry(entry=Entry.objects.get(race=race, seed=2), by=alice, now=now)
    html = page(client, race)
    rows = re.findall(r"<tr class=.*?</tr>", html, re.S)
    assert len(rows) == 2
    note = re.search(r'<p class="note card-foot">(.*?)</p>', html, re.S)[1]
    assert "No longer in the race" in note and ">car-2<" in note and "are kept" in note


@pytest.mark.parametrize("entrants", [0, 1])
def test_a_race_with_too_few_cars_for_duels_says_so(client, now, entrants):
    assert "final result" in page(client, drawn(now, entrants))


def test_the_board_ranks_by_points_once_duels_are_drawn(client, now):
    race = drawn(now, 2)
    for duel in driving(race):
        end(duel, now, winners=[2, 1])
    html = page(client, race, path="")
    assert html.index(">car-2</a>") < html.index(">car-1</a>") and "Points" in html
    assert "All duels" in html


# --- the organiser's button


def test_the_organiser_can_draw_immediately(client, now, alice):
    race = a_duel_race(now, organiser=alice)
    qualify(race, [a_racer(), a_racer()], now)
    assert "Draw now" in page(client, race, alice)
    response = client.post(f"/races/{race.slug}/duels/draw/")
    assert response.status_code == 302 and response.url == f"/races/{race.slug}/duels/"
    assert Draw.objects.get(race=race).entrants == 2 and len(driving(race)) == 1
    client.post(f"/races/{race.slug}/duels/draw/")
    assert Duel.objects.count() == 2, "pressing it twice changes nothing"


def test_drawing_too_early_says_why_not(client, alice):
    race = a_duel_race(timezone.now(), organiser=alice)
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    html = client.post(f"/races/{race.slug}/duels/draw/", follow=True).content.decode()
    assert "duels_before_closing" in html and not Draw.objects.exists()


@pytest.mark.parametrize(
    ("who", "status"), [("alice", 302), ("admin", 302), ("bob", 404), ("charlie", 404), (None, 302)]
)
def test_only_the_organiser_and_admins_may_draw(client, now, alice, bob, charlie, who, status):
    people = {"alice": alice, "bob": bob, "charlie": charlie, "admin": a_racer("admin-anna", is_staff=True)}
    race = a_duel_race(now, organiser=alice)
    qualify(race, [bob, a_racer()], now)
    if who:
        assert ("Draw now" in page(client, race, people[who])) == (status == 302)
    assert client.post(f"/races/{race.slug}/duels/draw/").status_code == status
    assert Draw.objects.exists() == (who in ("alice", "admin"))


def test_drawing_by_get_is_refused(client, now, alice):
    race = a_duel_race(now, organiser=alice)
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert client.get(f"/races/{race.slug}/duels/draw/").status_code == 405


# --- who sees


@pytest.mark.parametrize(
    ("who", "status"), [("alice", 200), ("admin", 200), ("bob", 200), ("charlie", 404), (None, 404)]
)
def test_only_members_see_the_duels_of_an_invitation_race(client, now, alice, bob, charlie, who, status):
    people = {"alice": alice, "bob": bob, "charlie": charlie, "admin": a_racer("admin-anna", is_staff=True)}
    race = a_duel_race(now, organiser=alice, visibility=Visibility.INVITATION)
    racers = [bob, a_racer()]
    for racer in racers:
        accept_invitation(token=race.invitation, racer=racer, now=now)
    qualify(race, racers, now)
    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    (duel,) = driving(race)
    end(duel, now)
    if who:
        client.force_login(people[who], backend="django.contrib.auth.backends.ModelBackend")
    assert client.get(f"/races/{race.slug}/duels/").status_code == status
    assert client.get(f"/evaluations/{duel.evaluation.public_id}/").status_code == status


def test_everybody_may_watch_the_duels_of_a_public_race(client, now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    assert client.get(f"/evaluations/{duel.evaluation.public_id}/").status_code == 200
    end(duel, now)
    html = client.get(f"/evaluations/{duel.evaluation.public_id}/").content.decode()
    assert race.name in html


def test_a_racer_cannot_stop_a_duel(client, now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    front = duel.evaluation.owner
    client.force_login(front, backend="django.contrib.auth.backends.ModelBackend")
    html = client.get(f"/evaluations/{duel.evaluation.public_id}/").content.decode()
    assert f"/evaluations/{duel.evaluation.public_id}/stop/" not in html
    assert client.post(f"/evaluations/{duel.evaluation.public_id}/stop/").status_code == 404
    duel.evaluation.refresh_from_db()
    assert duel.evaluation.state == "queued"


# --- queries


@pytest.mark.parametrize("format_", ["round_robin", "bracket"])
def test_more_cars_need_no_more_queries(client, now, format_):
    few, many = a_duel_race(now, duel_format=format_), a_duel_race(now, duel_format=format_)
    racers = [a_racer() for _ in range(6)]
    qualify(few, racers[:2], now)
    qualify(many, racers, now)
    for race in (few, many):
        draw_duels(race=race, now=race.closes_at)
        drive_on(race=race, now=race.closes_at)
    end_all(many, now)
    viewer = a_racer("viewer")
    client.force_login(viewer, backend="django.contrib.auth.backends.ModelBackend")
    before = len(queries(client, f"/races/{few.slug}/duels/"))
    assert len(queries(client, f"/races/{many.slug}/duels/")) <= before <= LIMIT


def test_my_runs_list_a_duel_under_its_race(client, now):
    race = drawn(now, 2, name="Duel night")
    (duel,) = driving(race)
    front = duel.evaluation.owner
    client.force_login(front, backend="django.contrib.auth.backends.ModelBackend")
    for path in ("/", f"/models/{duel.evaluation.model.public_id}/"):
        runs = re.findall(r'<th scope="row">\s*<a [^>]*>\s*([^<]*?)\s*</a>', client.get(path).content.decode())
        assert runs.count("Duel night") >= 2, path

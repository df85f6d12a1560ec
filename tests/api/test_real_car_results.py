"""A typed lap of a real car stands apart from every simulated result: through the API and on every page."""

from __future__ import annotations

import re
import uuid
from datetime import timedelta

import pytest
from django.db.models import Q
from django.utils import timezone

from accounts.models import Racer
from league.models import DuelRating
from league.racers.selectors import honours_of
from league.seasons.selectors import hall_of_fame
from races.duels.rivalry import head_to_head
from races.entries.selectors.visibility import races_visible_to
from races.models import Race
from tests.factories import a_race, a_track, drive, laps
from tracks.models import Track
from tracks.selectors import with_figures

pytestmark = pytest.mark.django_db


@pytest.fixture
def clean():
    """A race of simulated cars, closed: bob has won it before alice."""

    def make(alice: Racer, bob: Racer) -> Race:
        then = timezone.now() - timedelta(days=3)
        race = a_race(then, slug="clean", closes_at=then + timedelta(hours=1))
        drive(race, bob, laps(9_000, 8_000, 8_500), then)
        drive(race, alice, laps(9_500, 9_400, 9_300), then)
        return race

    return make


def forged(client, bob_client, track: Track) -> Race:
    """A race of real cars by a racer, in which they write themselves a lap of 0.6 s; bob has 12 s."""
    now = timezone.now()
    body = {
        **{"name": "Forged", "track": track.slug, "physical": True, "minimum_lap_ms": 500, "visibility": "public"},
        **{"ranking_method": "best", "minimum_laps": 1},
        **{"opens_at": now.isoformat(), "closes_at": (now + timedelta(days=1)).isoformat()},
    }
    made = client.post("/api/v1/races/", body, format="json")
    assert made.status_code == 201, made.content
    race = Race.objects.get(slug=made.json()["slug"])
    Race.objects.filter(pk=race.pk).update(opens_at=now - timedelta(hours=2))
    sessions = []
    for who, minutes, time_ms in ((client, 60, 600), (bob_client, 30, 12_000)):
        entered = who.post(f"/api/v1/races/{race.slug}/entry/", {}, format="json")
        assert entered.status_code in (200, 201), entered.content
        alias = who.get("/api/v1/me/").json()["alias"]
        lap = {"id": str(uuid.uuid4()), "number": 1, "time_ms": time_ms}
        started = (now - timedelta(minutes=minutes)).isoformat()
        about = {"id": str(uuid.uuid4()), "revision": 1, "racer": alias, "started_at": started, "ended": True}
        sessions.append({**about, "laps": [lap]})
    sent = {"sent_at": now.isoformat(), "sessions": sessions}
    taken = client.post(f"/api/v1/races/{race.slug}/sessions/", sent, format="json")
    assert taken.status_code == 200 and [one["code"] for one in taken.json()["results"]] == ["", ""], taken.content
    Race.objects.filter(pk=race.pk).update(closes_at=now - timedelta(seconds=1))
    race.refresh_from_db()
    assert race.fastest_lap_ms == 600
    return race


def test_a_forged_lap_stands_apart_everywhere(alice, bob, as_racer, clean, client):
    simulated = clean(alice, bob)
    forged(as_racer(alice), as_racer(bob), simulated.track)
    found = with_figures(Track.objects.filter(pk=simulated.track_id)).get()
    assert (found.record_ms, found.record_reverse_ms) == (8_000, None)

    honours = honours_of(alice, races_visible_to(None), timezone.now())
    assert (honours.wins, honours.podiums) == (0, 1), "the simulated race alone"
    assert (honours.real_wins, honours.real_podiums) == (1, 1)
    against = head_to_head(alice, bob, None)
    assert (against.races_ahead, against.races_behind) == (0, 1)
    assert hall_of_fame() == [] and not DuelRating.objects.exists()

    simulated.refresh_from_db()
    assert (simulated.fastest_lap_ms, simulated.fastest_sector_1_ms) != (600, None)
    assert simulated.fastest_lap_ms == 8_000
    assert not simulated.entries.filter(Q(best_lap_ms=600) | Q(own_lap_ms=600)).exists()


def test_pages_list_real_cars_by_event(alice, bob, as_racer, clean, client):
    simulated = clean(alice, bob)
    race = forged(as_racer(alice), as_racer(bob), simulated.track)
    page = client.get(f"/tracks/{simulated.track.slug}/").content.decode()
    facts, real = page.split('<dl class="facts">')[1].split("</dl>")[0], page.split('id="real-cars"')[1]
    assert "0:08.000" in facts and "0:00.600" not in facts
    assert race.name in real and "0:00.600" in real.split("</section>")[0]
    profile = re.sub(r">\s+<", "><", client.get(f"/racers/{alice.alias}/").content.decode())
    assert "<dt>Wins</dt><dd>0</dd><dt>Podiums</dt><dd>1</dd></dl>" in profile
    assert '<dl class="facts" id="real-cars"><dt>Wins</dt><dd>1</dd>' in profile
    assert profile.count('<span class="tag">Real cars</span>') == 1


def test_tracks_without_real_cars_say_nothing_of_them(client):
    assert 'id="real-cars"' not in client.get(f"/tracks/{a_track().slug}/").content.decode()

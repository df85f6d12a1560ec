"""What is left of a live event through the API: figures, highlights, CSV, PDF, certificates; and who gets them."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable

import pytest
from django.core.cache import cache
from django.urls import reverse
from django.utils import timezone

from accounts.models import Racer
from races.aftermath import api
from races.models import Entry, LiveEvent, Race, Visibility
from tests.factories import a_racer
from tests.kept import Kept
from tests.live_shows import an_ended_show
from videos.models import Video

pytestmark = pytest.mark.django_db
PATHS = ("live/figures/", "live/highlights/", "live/results/", "live/laps/", "results/", "certificates/bob/")


@pytest.fixture(scope="session")
def kept_ended_show(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, lambda: an_ended_show(timezone.now(), a_racer("alice")), fresh_s=60.0)


@pytest.fixture
def alice(db: None) -> Racer:
    return Racer.objects.filter(alias="alice").first() or a_racer("alice")


@pytest.fixture
def event(kept_ended_show: Kept, db: None, wakes, video_wakes, monkeypatch) -> LiveEvent:
    """An event that has ended: carl before dora and bob."""
    cache.clear()
    monkeypatch.setattr(api, "results_pdf", lambda *told: b"%PDF-")
    monkeypatch.setattr(api, "certificate", lambda *told: b"%PDF-")
    return kept_ended_show.copy()


def address(event, path: str) -> str:
    return f"/api/v1/races/{event.race.slug}/{path}"


def test_an_event_in_figures(event, client):
    told = client.get(address(event, "live/figures/")).json()
    assert told["fastest"] == {"racer": "carl", "time_ms": 8_000, "lap": 1}
    assert (told["runs"], told["laps"], told["lead_changes"], told["closest_ms"]) == (3, 6, 1, 500)
    assert [(one["racer"], one["rank"], one["best_lap_ms"]) for one in told["racers"]] == [
        ("carl", 1, 8_000),
        ("dora", 2, 8_500),
        ("bob", 3, 9_000),
    ]


def test_results_and_laps_as_csv(event, client):
    answers = [client.get(address(event, f"live/{name}/")) for name in ("results", "laps")]
    results, laps = ([*csv.DictReader(io.StringIO(answer.content.decode()))] for answer in answers)
    assert [row["racer"] for row in results] == ["carl", "dora", "bob"]
    assert len(laps) == 6 and laps[0]["time_ms"] == "9000"
    assert answers[0]["Content-Disposition"] == f'attachment; filename="{event.race.slug}-results.csv"'


def test_papers(event, client):
    for path in ("results/", "certificates/bob/"):
        answer = client.get(address(event, path))
        assert (answer.status_code, answer["Content-Type"], answer.content) == (200, "application/pdf", b"%PDF-")
    assert client.get(address(event, "certificates/nobody/")).status_code == 404
    Entry.objects.filter(race=event.race, racer__alias="bob").update(withdrawn_at=timezone.now())
    assert client.get(address(event, "certificates/bob/")).status_code == 404


def test_who_has_no_place_has_no_certificate(alice, wakes, client):
    event = an_ended_show(timezone.now(), alice, laps={"bob": (9_000,), "carl": ()})
    answer = client.get(address(event, "certificates/carl/"))
    assert (answer.status_code, answer.json()["code"]) == (404, "certificate_no_place")


def test_highlights_and_their_video(event, client, as_racer):
    at = address(event, "live/highlights/")
    told = client.get(at).json()
    assert told["video"] is None
    assert [(one["kind"], one["racer"]) for one in told["moments"]][-2:] == [("fastest", "carl"), ("closest", "dora")]
    assert "Fastest lap: carl, 0:08.000" in [one["caption"] for one in told["moments"]]
    assert client.post(at).status_code == 401
    bob = Racer.objects.get(alias="bob")
    asked = as_racer(bob).post(at)
    assert (asked.status_code, asked.json()["state"], asked.json()["lap"]) == (202, "waiting", None)
    assert as_racer(bob).post(at).status_code == 200 and Video.objects.get().asked_by == bob
    assert client.get(at).json()["video"]["public_id"] == asked.json()["public_id"]


def test_nothing_is_told_before_the_end(alice, wakes, client, as_racer):
    event = an_ended_show(timezone.now(), alice, end=False)
    for path in PATHS:
        answer = client.get(address(event, path))
        assert (answer.status_code, answer.json()["code"]) == (409, "results_not_yet"), path
    assert as_racer(alice).post(address(event, "live/highlights/")).json()["code"] == "results_not_yet"
    assert not Video.objects.exists()


def test_a_private_event_is_not_there_for_strangers(event, alice, as_racer, client):
    Race.objects.update(visibility=Visibility.INVITATION)
    mallory, bob = as_racer(a_racer("mallory")), Racer.objects.get(alias="bob")
    stella = a_racer("stella", is_staff=True)
    for path in PATHS:
        assert {client.get(address(event, path)).status_code, mallory.get(address(event, path)).status_code} == {404}
        for insider in (alice, bob, stella):
            assert as_racer(insider).get(address(event, path)).status_code == 200, path
    assert mallory.post(address(event, "live/highlights/")).status_code == 404


def test_nothing_is_told_to_who_wants_no_spoilers(event, client):
    for path in PATHS:
        answer = client.get(address(event, path), headers={"X-Paddock-Spoilers": "hide"})
        assert (answer.status_code, answer.json()["code"]) == (403, "results_hidden"), path


def test_who_asks_for_too_many_papers_waits(event, alice, as_racer, client):
    racer = as_racer(alice)
    found = [racer.get(address(event, "results/")).status_code for _ in range(21)]
    assert found == [200] * 20 + [429]
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert client.get(reverse("race_results_pdf", args=[event.race.slug])).status_code == 429, "pages count with it"

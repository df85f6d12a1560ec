"""The documents of replays: what they hold, who may read them, and long, wide, open and damaged ones."""

from __future__ import annotations

import gzip
import json
import math
from datetime import timedelta

import numpy as np
import pytest
from django.core.files.storage import default_storage
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from evaluation.models import Evaluation
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.checks import MAX_WAYPOINTS
from paddock.geometry.track import TrackGeometry
from races.entries.services.entries import accept_invitation
from races.models import Visibility, WatchedRace
from races.replays.document import car_events, scene_document, trace_columns
from races.spoilers.selectors import HIDDEN
from tests.drawn_runs import a_driven_run, driven_trace
from tests.evaluation.stubs import HEADER
from tests.factories import a_race, a_racer, a_track, lap
from tests.paddock.simulator.tracks_for_tests import stadium

pytestmark = pytest.mark.django_db


@pytest.fixture
def now():
    return timezone.now()


def trace(*steps: tuple[int, float, float, str]) -> bytes:
    """Of (episode, x, seconds, status)."""
    rows = [f"{e},1,{x},0,0,0,1.0,1,0,False,True,{x},1,18,{t},{status},0,0,{t}" for e, x, t, status in steps]
    return "\n".join([HEADER, *rows, ""]).encode()


def test_events_are_laps_incidents_and_resets():
    steps = [(0, 0.0, 0.0, "prepare"), (0, 0.2, 0.1, "in_progress"), (0, 0.4, 0.2, "off_track")]
    steps += [(0, 0.4, 0.3, "off_track"), (0, 2.0, 0.4, "in_progress"), (1, 2.2, 0.5, "crashed")]
    columns = trace_columns(trace(*steps))
    found = car_events(3, columns, [lap(1, 450), {**lap(2, 100, complete=False), "start_ms": 450}])
    assert [(event["t"], event["kind"]) for event in found] == [
        (200, "off_track"),
        (400, "reset"),
        (450, "lap"),
        (500, "crash"),
    ]
    assert {event["car"] for event in found} == {3}
    assert columns["lap"] == [1, 1, 1, 1, 1, 2] and columns["progress"][1] == 0.2


def test_a_document_has_the_trace_in_metres(now, client):
    alice = a_racer("alice")
    run = a_driven_run(a_race(now), alice, now)
    document = client.get(reverse("evaluation_replay", args=[run.public_id])).json()
    assert (document["run"], document["name"], document["track"]) == (run.public_id, "alice", run.track.slug)
    assert [each["start_ms"] for each in document["laps"]] == [0, 1_000, 1_999]
    assert set(map(len, document["columns"].values())) == {45}
    x, y, _ = run.track.geometry.point_at(0.0)
    assert (document["columns"]["x"][0], document["columns"]["y"][0]) == (round(x, 4), round(y, 4))


def test_documents_are_compressed_and_asked_for_once(now):
    alice = a_racer("alice")
    run = a_driven_run(a_race(now), alice, now)
    client = Client()
    client.force_login(alice)
    address = reverse("evaluation_replay", args=[run.public_id])
    answer = client.get(address, headers={"Accept-Encoding": "gzip"})
    assert answer["Content-Encoding"] == "gzip" and len(answer.content) < len(client.get(address).content) / 3
    again = client.get(address, headers={"If-None-Match": answer["ETag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_the_documents_of_a_page_come_together(now, client):
    race = a_race(now)
    mine, theirs = a_driven_run(race, a_racer("alice"), now), a_driven_run(race, a_racer("bob"), now)
    setup = json.loads(
        client.get(reverse("replay", args=[mine.public_id]), {"with": theirs.public_id}).context["viewer"]
    )
    answer = client.get(setup["together"], headers={"Accept-Encoding": "gzip"})
    found = json.loads(gzip.decompress(answer.content))
    assert found == {url: client.get(url).json() for url in (setup["scene"], *(run["url"] for run in setup["runs"]))}
    assert client.get(setup["together"], headers={"If-None-Match": answer["ETag"]}).status_code == 304
    theirs.result.trace.delete(save=False)
    assert set(client.get(setup["together"]).json()) == set(found) - {setup["runs"][1]["url"]}


def test_documents_that_come_together_are_those_that_the_reader_may_see(now, client):
    alice, bob = a_racer("alice"), a_racer("bob")
    mine = a_driven_run(a_race(now), alice, now)
    secret = a_race(now, visibility=Visibility.INVITATION, organiser=alice)
    accept_invitation(token=secret.invitation, racer=bob, now=now)
    private = a_driven_run(secret, bob, now)
    addresses = [reverse("evaluation_replay", args=[run.public_id]) for run in (mine, private)]
    guest = client.get(addresses[0], {"with": private.public_id})
    assert addresses[0] in guest.json() and addresses[1] not in guest.json()
    assert client.get(addresses[1], {"with": mine.public_id}).status_code == 404
    client.force_login(alice)
    assert addresses[1] in client.get(addresses[0], {"with": private.public_id}).json()
    Evaluation.with_sealed.filter(pk=private.pk).update(sealed=True)
    assert addresses[1] not in client.get(addresses[0], {"with": private.public_id}).json()


def test_a_new_look_or_name_is_another_document(now, client):
    run = a_driven_run(a_race(now), a_racer("alice"), now)
    address = reverse("evaluation_replay", args=[run.public_id])
    before = client.get(address)["ETag"]
    run.model.colour = "#a3e635"
    run.model.save()
    answer = client.get(address, headers={"If-None-Match": before})
    assert answer.status_code == 200 and answer.json()["look"]["colour"] == "#a3e635"


def test_private_and_sealed_runs_are_nobodys_ghosts(now):
    """The owner and the organiser see a private run; a sealed one is for nobody, not even staff."""
    alice, bob, stranger = a_racer("alice"), a_racer("bob"), a_racer("stranger")
    member, staff = a_racer("member"), a_racer("staff", is_staff=True)
    mine = a_driven_run(a_race(now, slug="public", organiser=alice), alice, now)
    secret = a_race(now, slug="secret", organiser=alice, visibility=Visibility.INVITATION)
    for racer in (bob, member):
        accept_invitation(token=secret.invitation, racer=racer, now=now)
    private = a_driven_run(secret, bob, now)

    def answers(racer) -> tuple[int, str, bool]:
        """The document, the refusal of the page with it as ghost, and whether the page offers it."""
        client = Client()
        if racer is not None:
            client.force_login(racer)
        at = reverse("replay", args=[mine.public_id])
        page = client.get(at, {"with": private.public_id}, follow=True).content.decode()
        refusal = page.partition('data-code="')[2].partition('"')[0]
        offers = private.public_id in client.get(at).content.decode()
        return client.get(reverse("evaluation_replay", args=[private.public_id])).status_code, refusal, offers

    for racer in (None, stranger):
        assert answers(racer) == (404, "compare_unknown", False)
    for racer in (alice, bob, member, staff):
        assert answers(racer) == (200, "", True)
    Evaluation.with_sealed.filter(pk=private.pk).update(sealed=True)
    for racer in (None, stranger, alice, bob, member, staff):
        assert answers(racer) == (404, "compare_unknown", False)


def test_hidden_results_hide_the_replay_the_ghost_and_the_offer(now):
    alice = a_racer("alice", hides_results_since=now - timedelta(hours=1))
    watched = a_race(now, slug="seen", organiser=alice)
    WatchedRace.objects.create(racer=alice, race=watched, at=now)
    mine = a_driven_run(watched, alice, now)
    theirs = a_driven_run(a_race(now, slug="spoiler"), a_racer("bob"), now)
    client = Client()
    client.force_login(alice)
    refused = client.get(reverse("evaluation_replay", args=[theirs.public_id]))
    assert refused.json()["code"] == HIDDEN.code and "columns" not in refused.json()
    together = client.get(reverse("evaluation_replay", args=[mine.public_id]), {"with": theirs.public_id})
    assert together.json()["code"] == HIDDEN.code
    at = reverse("replay", args=[mine.public_id])
    page = client.get(at)
    assert page.status_code == 200 and page.context["offers"] == []
    for ghost in (theirs.public_id, theirs.get_absolute_url(), f"{theirs.public_id}:2"):
        page = client.get(at, {"with": ghost}).content.decode()
        assert "data-viewer" not in page and "s ahead of" not in page
    assert client.get(at, {"with": "fast"}).url == at, "no word names it"
    alice.hides_results_since = None
    alice.save()
    [offered] = client.get(at).context["offers"]
    assert f"?with={theirs.public_id}" in offered


@pytest.mark.parametrize("fault", ["gone", "damaged"])
def test_a_trace_that_is_gone_or_damaged_leaves_the_page(now, fault):
    alice = a_racer("alice")
    race = a_race(now)
    mine, theirs = a_driven_run(race, alice, now), a_driven_run(race, a_racer("bob"), now)
    name = theirs.result.trace.name
    default_storage.delete(name)
    if fault == "damaged":
        with default_storage.open(name, "wb") as file:
            file.write(b"no gzip")
    client = Client()
    document = client.get(reverse("evaluation_replay", args=[theirs.public_id]))
    assert document.status_code == 503
    page = client.get(reverse("replay", args=[mine.public_id]), {"with": theirs.public_id, "analysis": "1"})
    assert page.status_code == 200 and page.context["verdicts"] == [] and len(page.context["runs"]) == 2


def test_a_trace_with_other_columns_is_damaged():
    for content in (b"a,b\n1,2\n", b"\xff\xfe", driven_trace(a_track(), 1)[:-40]):
        with pytest.raises(PlatformFault) as fault:
            trace_columns(content)
        assert fault.value.code == "file_damaged"


def test_an_open_track_has_its_run_off_and_its_finish():
    angle = np.linspace(0, np.pi, 60)
    lines = [np.column_stack((radius * np.cos(angle), radius * np.sin(angle))) for radius in (3.0, 2.6, 3.4)]
    geometry = TrackGeometry.from_arrays("Arc", *lines, is_open=True)
    scene = scene_document(_Row(geometry), "ccw")
    assert scene["closed"] is False and len(scene["centre"]) == len(scene["inner"]) == len(scene["outer"]) == 62
    pairs = zip(scene["inner"], scene["outer"], strict=True)
    assert all(math.dist(inner, outer) == pytest.approx(0.8, abs=0.01) for inner, outer in pairs)
    assert scene["start"]["x"] == pytest.approx(3.0, abs=0.01) and scene["finish"]["x"] == pytest.approx(-3.0, abs=0.01)


def a_ring(points: int) -> TrackGeometry:
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
    lines = [np.column_stack((radius * np.cos(angle), radius * np.sin(angle))) for radius in (20.0, 19.5, 20.5)]
    return TrackGeometry.from_arrays("Ring", *lines)


def test_the_largest_track_is_one_document():
    scene = scene_document(_Row(a_ring(MAX_WAYPOINTS)), "cw")
    assert len(scene["centre"]) == MAX_WAYPOINTS and len(json.dumps(scene)) < 200_000
    with pytest.raises(UserFault) as fault:
        a_ring(5_000)
    assert fault.value.code == "track_too_large"


def test_the_turns_of_a_direction_are_numbered(client):
    track = a_track()
    address = reverse("track_scene", args=[track.slug])
    for direction in ("ccw", "cw"):
        scene = client.get(address, {"direction": direction}).json()
        assert [turn["number"] for turn in scene["turns"]] == [1, 2] and scene["direction"] == direction
    assert client.get(address, {"direction": "up"}).status_code == 404
    assert len(scene_document(_Row(stadium()), "ccw")["turns"]) == 2


class _Row:
    """What a scene document reads of a track's row."""

    def __init__(self, geometry: TrackGeometry) -> None:
        self.slug, self.name, self.geometry = "a-track", geometry.name, geometry

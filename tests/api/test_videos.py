"""Videos in the API: asked for, followed, downloaded in parts; who may what."""

from __future__ import annotations

import pytest
from django.utils import timezone

from races.entries.services.entries import accept_invitation
from races.models import Visibility
from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from videos.models import Video
from videos.services import VIDEOS, run_next_video

pytestmark = pytest.mark.django_db


@pytest.fixture
def run(alice, video_wakes):
    now = timezone.now()
    return a_driven_run(a_race(now), alice, now)


@pytest.fixture
def address(run) -> str:
    return f"/api/v1/evaluations/{run.public_id}/videos/"


def test_a_video_can_be_requested_and_downloaded(cast, address, run):
    member = cast["member"]
    asked = member.post(address, {"part": "whole"})
    assert asked.status_code == 202
    video = asked.json()
    assert (video["state"], video["position"], video["lap"], video["file"]) == ("waiting", 1, None, None)
    again = member.post(address, {"part": "whole"})
    assert (again.status_code, again.json()["public_id"]) == (200, video["public_id"])
    one = f"/api/v1/videos/{video['public_id']}/"
    assert member.get(f"{one}file/").status_code == 404
    claim = VIDEOS.claim(worker="w", now=timezone.now())
    assert member.get(one).json()["state"] == "drawing"
    Video.objects.filter(pk=claim.pk).update(state="waiting", lease=None, leased_until=None, started_at=None)
    assert run_next_video(worker="w")
    ready = cast["anonymous"].get(one).json()
    assert (ready["state"], ready["evaluation"], ready["progress"]) == ("ready", run.public_id, 100)
    whole = cast["anonymous"].get(ready["file"])
    content = whole.getvalue()
    assert len(content) == ready["size"] and whole["Content-Type"] == "video/mp4"
    assert f"{run.public_id}-run.mp4" in whole["Content-Disposition"]
    part = cast["anonymous"].get(ready["file"], headers={"range": "bytes=2-5"})
    assert (part.status_code, part.getvalue()) == (206, content[2:6])
    assert cast["anonymous"].get(ready["file"], headers={"if-none-match": whole["ETag"]}).status_code == 304
    assert cast["anonymous"].get(ready["file"], headers={"range": "bytes=99999-"}).status_code == 416
    assert [each["public_id"] for each in cast["stranger"].get(address).json()["results"]] == [video["public_id"]]


def test_a_video_is_of_the_best_lap_in_the_requests_language(cast, address):
    asked = cast["member"].post(address, headers={"accept-language": "ko"}).json()
    assert (asked["lap"], asked["car"], asked["language"]) == (2, 0, "ko")
    assert cast["member"].post(address, {"language": "en"}).json()["language"] == "en"


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        ({"part": "9"}, 400, "video_lap_unknown"),
        ({"part": "all"}, 400, "video_part"),
        ({"car": 3}, 400, "car_number"),
        ({"car": -1}, 400, "invalid"),
        ({"language": "tlh"}, 400, "invalid"),
        ({"lap": 1}, 400, "invalid"),
    ],
)
def test_a_refused_video_says_why(cast, address, body, status, code):
    answer = cast["member"].post(address, body)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


def test_exceeding_a_limit_is_a_conflict(cast, address, settings):
    settings.VIDEOS_AT_ONCE = 1
    cast["member"].post(address, {"part": "1"})
    answer = cast["member"].post(address, {"part": "2"})
    assert (answer.status_code, answer.json()["code"]) == (409, "videos_at_once")
    settings.VIDEOS = False
    assert cast["owner"].post(address, {"part": "2"}).json()["code"] == "videos_off"


def test_only_the_requester_and_admins_stop_a_video(cast, address):
    for stops, refused in (("member", ("stranger", "owner")), ("admin", ())):
        video = cast["member"].post(address).json()["public_id"]
        stop = f"/api/v1/videos/{video}/stop/"
        assert cast["anonymous"].post(stop).status_code == 401
        for role in refused:
            assert cast[role].post(stop).status_code == 403
        answer = cast[stops].post(stop)
        assert (answer.status_code, answer.json()["reason"]["code"]) == (200, "video_stopped")
        assert cast[stops].post(stop).status_code == 200


def test_only_members_see_videos_of_a_private_race(cast, alice, bob, video_wakes):
    now = timezone.now()
    race = a_race(now, organiser=alice, visibility=Visibility.INVITATION)
    for racer in (alice, bob):
        accept_invitation(token=race.invitation, racer=racer, now=now)
    run = a_driven_run(race, alice, now)
    address = f"/api/v1/evaluations/{run.public_id}/videos/"
    video = cast["member"].post(address).json()["public_id"]
    run_next_video(worker="w")
    for role, client in cast.items():
        expected = 200 if role in ("owner", "member", "admin") else 404
        for path in (address, f"/api/v1/videos/{video}/", f"/api/v1/videos/{video}/file/"):
            assert client.get(path).status_code == expected, (role, path)
    assert cast["stranger"].post(address).status_code == 404
    assert cast["anonymous"].post(address).status_code == 401


def test_a_video_with_an_old_alias_is_stale_and_not_served(cast, address, bob, alice):
    video = cast["member"].post(address).json()["public_id"]
    run_next_video(worker="w")
    type(alice).objects.filter(pk=alice.pk).update(alias="alicia")
    answer = cast["member"].get(f"/api/v1/videos/{video}/").json()
    assert (answer["state"], answer["file"], answer["sha256"]) == ("stale", None, None)
    assert cast["member"].get(f"/api/v1/videos/{video}/file/").status_code == 404

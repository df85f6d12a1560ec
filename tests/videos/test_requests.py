"""Asking for a video of a run: what is made, for whom, how often, and what is refused."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import IntegrityError, transaction

from evaluation.appearance.looks import VehicleLook
from evaluation.garage.services import describe_model
from evaluation.models import Evaluation
from paddock.errors import UserFault
from races.entries.selectors.visibility import evaluations_visible_to
from races.entries.services.submissions import submit_model
from races.models import Visibility
from tests.drawn_runs import a_driven_run
from tests.factories import a_model, a_race, a_racer, drive, laps, start
from videos.models import UNDER_WAY, Video, VideoState
from videos.scenes import VideoRun
from videos.selectors import (
    can_request_video,
    can_see_video,
    can_stop_video,
    evaluations_for_videos,
    shown_video,
    videos_to_stop,
    videos_visible_to,
)
from videos.services import request_video, run_next_video, stop_video

pytestmark = pytest.mark.django_db


@pytest.fixture
def run(alice, now, video_wakes) -> Evaluation:
    """Three laps of alice's, the second the fastest."""
    return a_driven_run(a_race(now), alice, now)


def ask(run, by, now, part="best", car=0, language="en"):
    return request_video(evaluation=run, by=by, car=car, part=part, language=language, now=now)


def code_of(*args, **kwargs) -> str:
    with pytest.raises(UserFault) as refused:
        ask(*args, **kwargs)
    return refused.value.code


class TestRequest:
    def test_it_is_queued_and_sends_a_wake_up(self, run, bob, now, video_wakes, commits):
        asked = ask(run, bob, now)
        video = asked.video
        assert asked.queued
        assert (video.state, video.car, video.part, video.language) == (VideoState.WAITING, 0, 2, "en")
        assert (video.asked_by, video.asked_at) == (bob, now)
        assert [wake["queue"] for wake in video_wakes] == ["videos"]

    def test_it_is_made_once_however_many_ask(self, run, alice, bob, now):
        first = ask(run, bob, now)
        again = ask(run, alice, now, part="2")
        assert not again.queued and again.video == first.video
        assert Video.objects.count() == 1

    def test_another_part_or_language_is_another_video(self, run, alice, now, settings):
        settings.VIDEOS_AT_ONCE = 10
        kinds = [("best", "en"), ("best", "ko"), ("whole", "en"), ("1", "en"), ("3", "en")]
        assert len({ask(run, alice, now, part=part, language=language).video.pk for part, language in kinds}) == 5

    def test_the_database_refuses_a_second_equal_video(self, run, alice, now):
        video = ask(run, alice, now).video
        with pytest.raises(IntegrityError), transaction.atomic():
            Video.objects.create(evaluation=run, car=0, part=video.part, language="en")

    @pytest.mark.parametrize(
        ("what", "code"),
        [
            ({"part": "4"}, "video_lap_unknown"),
            ({"part": "0"}, "video_lap_unknown"),
            ({"part": "-1"}, "video_part"),
            ({"part": "²"}, "video_part"),
            ({"part": "9" * 5000}, "video_lap_unknown"),
            ({"car": 1}, "car_number"),
            ({"language": "tlh"}, "video_language"),
        ],
    )
    def test_an_unknown_part_or_language_is_refused(self, run, alice, now, what, code):
        assert code_of(run, alice, now, **what) == code

    def test_an_unfinished_run_is_refused(self, alice, now, video_wakes):
        submission = submit_model(race=a_race(now), racer=alice, model=a_model(alice), now=now)
        start(submission.evaluation, now)
        assert code_of(submission.evaluation, alice, now) == "video_run_not_finished"

    def test_a_best_lap_needs_a_completed_lap(self, alice, now, video_wakes):
        from tests.factories import lap

        evaluation = drive(a_race(now), alice, [lap(1, 9_000, complete=False)], now).evaluation
        assert code_of(evaluation, alice, now) == "video_no_best_lap"
        assert ask(evaluation, alice, now, part="whole").video.part == 0

    def test_a_video_beyond_the_sites_length_is_refused(self, run, alice, now, settings):
        settings.VIDEO_SECONDS = 2
        assert code_of(run, alice, now, part="whole") == "video_too_long"
        assert ask(run, alice, now, part="best").queued

    def test_it_is_refused_when_videos_are_switched_off(self, run, alice, now, settings):
        settings.VIDEOS = False
        assert code_of(run, alice, now) == "videos_off"


class TestLimits:
    def test_videos_under_way_are_limited(self, run, alice, bob, now, settings):
        settings.VIDEOS_AT_ONCE = 2
        ask(run, alice, now, "1"), ask(run, alice, now, "2")
        assert code_of(run, alice, now, "3") == "videos_at_once"
        assert ask(run, alice, now, "1").video  # what is in the queue is no second one
        assert ask(run, bob, now, "3").queued
        stop_video(video=Video.objects.get(part=1), now=now)
        assert ask(run, alice, now, "whole").queued

    def test_requests_per_day_are_limited_stopped_ones_included(self, run, alice, now, settings):
        settings.VIDEOS_A_DAY = 3
        for _ in range(3):
            stop_video(video=ask(run, alice, now, "1").video, now=now)
        assert code_of(run, alice, now, "1") == "videos_a_day"
        assert code_of(run, alice, now, "2") == "videos_a_day"
        assert ask(run, alice, now + timedelta(days=1), "1").queued
        assert Video.objects.get().asks == 1


class TestANewNameOrLook:
    def test_it_makes_a_video_stale_and_appears_in_the_next(self, run, alice, bob, now):
        video = ask(run, alice, now).video
        assert run_next_video(worker="w")
        video.refresh_from_db()
        assert shown_video(video).state == "ready"
        old = video.file.name
        describe_model(model=run.model, name="Bolt", description="", look=VehicleLook("kart", "#ff0000"))
        run.model.refresh_from_db()
        video = Video.objects.get()
        assert shown_video(video).state == "stale"
        again = ask(run, bob, now + timedelta(minutes=1))
        assert again.queued and again.video.pk == video.pk
        assert run_next_video(worker="w")
        video.refresh_from_db()
        assert shown_video(video).state == "ready"
        assert video.file.name != old

    @pytest.mark.parametrize("change", ["alias", "race", "track"])
    def test_it_counts_wherever_a_name_is_written(self, run, alice, now, change):
        def fingerprint():
            related = ("result", "track", "owner", "model", "submission__entry__race", "duel__race")
            return VideoRun.of(Evaluation.objects.select_related(*related).get()).fingerprint(0, 2, "en")

        before = fingerprint()
        assert fingerprint() == before
        race = run.submission.entry.race
        changed = {"alias": (alice, "alias"), "race": (race, "name"), "track": (run.track, "name")}[change]
        type(changed[0]).objects.filter(pk=changed[0].pk).update(**{changed[1]: "another"})
        assert fingerprint() != before


class TestPermissions:
    """Alice races and organises, Bob is in the race, Charlie is a stranger, Stella is an admin."""

    @pytest.fixture
    def cast(self, alice, bob, charlie):
        stella = a_racer("stella", is_staff=True)
        guest = AnonymousUser()
        return {"alice": alice, "bob": bob, "charlie": charlie, "stella": stella, "guest": guest, "nobody": None}

    @pytest.mark.parametrize("visibility", Visibility.values)
    def test_only_those_allowed_watch_ask_and_stop(self, cast, now, video_wakes, visibility):
        from races.entries.services.entries import accept_invitation, enter_race

        race = a_race(now, organiser=cast["alice"], visibility=visibility)
        for name in ("alice", "bob"):
            if visibility == Visibility.INVITATION:
                accept_invitation(token=race.invitation, racer=cast[name], now=now)
            else:
                enter_race(race=race, racer=cast[name], now=now)
        best = drive(race, cast["alice"], laps(9_000, 9_000, 9_000), now).evaluation
        worse = drive(race, cast["alice"], laps(9_500, 9_500, 9_500), now).evaluation
        videos = {
            name: ask(run, cast[by], now).video for name, run, by in (("best", best, "bob"), ("worse", worse, "alice"))
        }
        members = {"alice", "bob", "stella"}
        everybody = members if visibility == Visibility.INVITATION else set(cast)
        sees = {"best": everybody, "worse": {"alice", "stella"}}
        stops = {"best": {"bob", "stella"}, "worse": {"alice", "stella"}}
        for name, racer in cast.items():
            for kind, video in videos.items():
                assert can_see_video(racer, video) == (name in sees[kind]), (name, kind)
                asks = name in sees[kind] and name not in ("guest", "nobody")
                assert can_request_video(racer, video.evaluation) == asks, (name, kind)
                assert can_stop_video(racer, video) == (name in stops[kind]), (name, kind)
            seen = [video for video in videos.values() if can_see_video(racer, video)]
            assert {*videos_visible_to(racer)} == {*seen}, name
            asked = {v.evaluation_id for v in videos.values() if can_request_video(racer, v.evaluation)}
            assert {*evaluations_for_videos(racer).values_list("pk", flat=True)} == asked, name
            assert {*videos_to_stop(racer)} == {v for v in videos.values() if can_stop_video(racer, v)}, name

    def test_a_running_run_cannot_be_drawn_nor_a_done_video_stopped(self, cast, now, video_wakes):
        alice = cast["alice"]
        running = submit_model(race=a_race(now), racer=alice, model=a_model(alice), now=now).evaluation
        assert not can_request_video(alice, running)
        assert running not in evaluations_for_videos(alice) and running in evaluations_visible_to(alice)
        video = ask(a_driven_run(a_race(now), alice, now), alice, now).video
        run_next_video(worker="w")
        video.refresh_from_db()
        assert video.state not in UNDER_WAY
        assert not can_stop_video(alice, video) and video not in videos_to_stop(alice)

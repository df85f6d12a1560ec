"""A car's report: asked for, dealt out to workers, counted once, stopped, deleted."""

from __future__ import annotations

import uuid
from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import IntegrityError, transaction

from accounts.quotas import used_by
from evaluation.garage.services import delete_model, purge_garages, share_model
from evaluation.models import State
from evaluation.models.reports import CarReport, ReportChunk, ReportLap
from evaluation.reports import planning, quotas, selectors
from evaluation.reports.jobs import CHUNKS, finish_chunk, run_next_chunk, wake_if_due
from evaluation.reports.planning import LEAGUE, chunks_of, plan
from evaluation.reports.selectors import can_see_report, can_stop_report, figures_of, is_report_of, reports_visible_to
from evaluation.reports.services import (
    delete_report,
    drive_report_again,
    purge_reports,
    request_report,
    stop_report,
)
from evaluation.running.queue.order import BACKGROUND
from evaluation.running.queue.services import queue_evaluation
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.rules.report import VARIATIONS
from tests.evaluation.reports import a_report, came_round, drive, off_the_road, outcome_of
from tests.factories import a_model, a_racer, a_track
from tests.rows import track_row
from tests.wakeups import heard
from tracks.models import Track

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def report_wakes(monkeypatch, wakes):
    return heard(monkeypatch, "evaluation.tasks.drive_reports")


def open_track() -> Track:
    return track_row(next(entry.slug for entry in CATALOGUE if entry.is_open))


# --- what is driven


def test_the_league_is_driven_both_ways_and_the_variations_after_it(
    alice, now, report_wakes, django_capture_on_commit_callbacks
):
    rows = [track_row(slug) for slug in LEAGUE]
    with django_capture_on_commit_callbacks(execute=True):
        report = request_report(owner=alice, model=a_model(alice), variations_on=a_track(), now=now)
    laps = list(report.laps.order_by("number").select_related("track"))
    assert [(lap.track.slug, lap.direction) for lap in laps[:4]] == [
        ("baja-turnpike", "ccw"),
        ("baja-turnpike", "cw"),
        ("baja-highway", "ccw"),
        ("baja-highway", "cw"),
    ]
    assert [lap.variation for lap in laps] == [None] * 2 * len(rows) + [*range(VARIATIONS)]
    assert report.rules["laps"] == 1 and report.rules["max_resets"] == 0
    assert 6 <= report.chunks.count() <= 14 and report.state == State.QUEUED
    assert report_wakes and len(report_wakes) == min(8, report.chunks.count())


def test_chunks_hold_what_a_worker_drives_in_some_seconds(oval):
    laps = plan([], oval, "ccw")
    quick = list(chunks_of(laps, macs=500_000))
    slow = list(chunks_of(laps, macs=60_000_000))
    slowest = list(chunks_of(laps, macs=600_000_000))
    assert [len(chunk) for chunk in quick] == [20] * 5
    assert 2 <= len(slow[0]) < 10 and len(slowest[0]) == 1
    assert [lap for chunk in slow for lap in chunk] == laps


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"track_set": "none", "tracks": [], "variations_on": None}, "report_empty"),
        ({"track_set": "league"}, "report_tracks"),
        ({"tracks": []}, "report_tracks"),
        ({"seed": -1}, "report_seed"),
        ({"seed": 2**31}, "report_seed"),
        ({"direction": "up"}, "report_direction"),
    ],
)
def test_what_makes_no_sense_is_refused_and_changes_nothing(alice, now, options, code):
    with pytest.raises(UserFault) as refused:
        a_report(alice, now, **options)
    assert refused.value.code == code and not CarReport.objects.exists()


def test_a_track_without_a_shape_is_refused(alice, now):
    named = Track.objects.create(slug="named", name="Named", npy=b"", fingerprint="f" * 64, direction="ccw")
    for options in ({"tracks": [named]}, {"variations_on": named}):
        with pytest.raises(UserFault, match="Named") as refused:
            a_report(alice, now, **options)
        assert refused.value.code == "report_track_without_shape"


def test_an_open_track_has_no_lap_to_vary_but_is_driven_both_ways(alice, now):
    track = open_track()
    with pytest.raises(UserFault, match="from start to end") as refused:
        a_report(alice, now, variations_on=track)
    assert refused.value.code == "report_no_way_round"
    report = a_report(alice, now, tracks=[track], variations_on=None)
    assert {lap.direction for lap in report.laps.all()} == {"ccw", "cw"}


def test_a_variation_that_has_no_place_refuses_the_report(alice, now, monkeypatch):
    from paddock.simulator import randomisation

    monkeypatch.setattr(randomisation.Pose, "ahead", lambda pose, forward, left=0.0: (1e6, 1e6))
    with pytest.raises(UserFault, match="Paddock Oval") as refused:
        a_report(alice, now)
    assert refused.value.code == "variation_not_placed" and not ReportChunk.objects.exists()


def test_too_many_tracks_are_refused(alice, now, monkeypatch):
    monkeypatch.setattr(planning, "MOST_TRACKS", 1)
    with pytest.raises(UserFault) as refused:
        a_report(alice, now, tracks=[a_track(), open_track()])
    assert refused.value.code == "report_too_many_tracks"


def test_sensors_that_no_track_serves_are_refused(alice, now):
    model = a_model(alice)
    model.metadata = model.metadata | {"sensor": ["FRONT_FACING_CAMERA", "SONAR"]}
    model.save()
    with pytest.raises(UserFault, match="SONAR") as refused:
        a_report(alice, now, model=model)
    assert refused.value.code == "report_sensors"


def test_only_a_model_that_the_racer_may_use_is_driven(alice, bob, now):
    left, shared, kept = a_model(alice), a_model(bob), a_model(bob)
    delete_model(model=left, now=now)
    share_model(model=shared, now=now)
    a_report(alice, now, model=shared)
    for model in (left, kept):
        with pytest.raises(UserFault) as refused:
            a_report(alice, now, model=model)
        assert refused.value.code == "report_model_gone"
    assert CarReport.objects.count() == 1


# --- the queue


def test_it_waits_behind_every_run_that_somebody_waits_for(alice, bob, now):
    a_report(alice, now)
    run = queue_evaluation(owner=bob, model=a_model(bob), track=a_track(), rules=RaceRules(), now=now)
    assert CHUNKS.claim(worker="w", now=now) is None
    assert not run_next_chunk(worker="w")
    run.priority = BACKGROUND
    run.save()
    assert CHUNKS.claim(worker="w", now=now) is not None


def test_who_has_ended_all_evaluations_wakes_the_reports(alice, now, report_wakes, django_capture_on_commit_callbacks):
    with django_capture_on_commit_callbacks(execute=True):
        wake_if_due(now)
    assert report_wakes == []
    a_report(alice, now)
    with django_capture_on_commit_callbacks(execute=True):
        wake_if_due(now)
    assert len(report_wakes) == 1


def test_reports_take_turns_chunk_by_chunk(alice, bob, now):
    first, second = a_report(alice, now), a_report(bob, now)
    turns = [CHUNKS.claim(worker="w", now=now).report_id for _ in range(4)]
    assert turns == [first.pk, second.pk] * 2


def test_a_lost_workers_chunk_is_repeated_and_counted_once(alice, now):
    report = a_report(alice, now)
    lost = CHUNKS.claim(worker="lost", now=now)
    CHUNKS.beat(pk=lost.pk, lease=lost.lease, progress=7, now=now)
    later = now + CHUNKS.lease + timedelta(seconds=1)
    assert CHUNKS.sweep(now=later).requeued == 1
    again = CHUNKS.claim(worker="other", now=later)
    assert (again.pk, again.attempt, again.progress) == (lost.pk, 2, 0)
    assert finish_chunk(pk=again.pk, lease=again.lease, outcome=outcome_of(again), now=later)
    late = outcome_of(lost, off_the_road(*range(VARIATIONS)))
    assert not finish_chunk(pk=lost.pk, lease=lost.lease, outcome=late, now=later)
    drive(report, later)
    assert report.laps.filter(complete=True).count() == VARIATIONS + 2
    assert (report.state, report.grade) == (State.FINISHED, "A")


def test_progress_counts_what_all_workers_have_done(alice, now):
    report = a_report(alice, now)
    one, other = (CHUNKS.claim(worker=name, now=now) for name in "ab")
    finish_chunk(pk=one.pk, lease=one.lease, outcome=outcome_of(one), now=now)
    CHUNKS.beat(pk=other.pk, lease=other.lease, progress=5, now=now)
    shown = reports_visible_to(alice).get()
    assert (shown.driven, shown.laps_in_all, shown.state) == (one.laps.count() + 5, VARIATIONS + 2, State.RUNNING)
    assert selectors.workers_at(report) == 1


def test_the_order_and_the_cut_of_chunks_change_no_hash(alice, now, monkeypatch):
    model = a_model(alice)
    first = drive(a_report(alice, now, model=model), now)
    monkeypatch.setattr(planning, "MOST_IN_CHUNK", 7)
    monkeypatch.setattr(CHUNKS, "order", ("-number", "-pk"))
    second = drive(a_report(alice, now, model=model), now)
    assert second.chunks.count() > first.chunks.count()
    assert first.runs_sha256 == second.runs_sha256 and len(first.runs_sha256) == 64
    other_seed = drive(a_report(alice, now, model=model, seed=1), now)
    other_laps = drive(a_report(alice, now, model=model), now, off_the_road(99))
    assert len({first.runs_sha256, other_seed.runs_sha256, other_laps.runs_sha256}) == 3


def test_what_another_engine_drove_is_driven_again(alice, now):
    report = a_report(alice, now)
    old = CHUNKS.claim(worker="w", now=now)
    finish_chunk(pk=old.pk, lease=old.lease, outcome=outcome_of(old, engine="paddock-0"), now=now)
    drive(report, now)
    assert set(report.chunks.values_list("engine", flat=True)) == {report.engine} and report.engine != "paddock-0"
    assert report.laps.filter(complete=None).count() == 0


def test_a_fault_of_the_model_ends_the_report_with_its_reason(alice, now):
    report = a_report(alice, now)
    chunk, other = (CHUNKS.claim(worker="w", now=now) for _ in range(2))
    CHUNKS.fail(pk=chunk.pk, lease=chunk.lease, fault=UserFault("policy_memory", limit_mb=5), now=now)
    report.refresh_from_db()
    assert (report.state, report.reason_code) == (State.FAILED, "policy_memory") and "5 MB" in report.reason
    assert CHUNKS.claim(worker="w", now=now) is None
    assert finish_chunk(pk=other.pk, lease=other.lease, outcome=outcome_of(other), now=now)
    CHUNKS.sweep(now=now)
    report.refresh_from_db()
    assert report.state == State.FAILED and report.runs_sha256 == ""
    assert set(report.chunks.values_list("state", flat=True)) == {"failed", "finished", "stopped"}


def test_a_fault_of_ours_is_tried_again(alice, now):
    report = a_report(alice, now)
    chunk = CHUNKS.claim(worker="w", now=now)
    CHUNKS.fail(pk=chunk.pk, lease=chunk.lease, fault=PlatformFault("runner_error", detail="x"), now=now)
    drive(report, now)
    assert report.state == State.FINISHED and report.chunks.get(pk=chunk.pk).attempt == 2


# --- stop, again, delete


def test_stopping_ends_all_chunks_and_workers_write_nothing(alice, now):
    report = a_report(alice, now)
    chunk = CHUNKS.claim(worker="w", now=now)
    assert stop_report(report=report, now=now) and report.state == State.STOPPED
    assert not CHUNKS.beat(pk=chunk.pk, lease=chunk.lease, now=now)
    assert not finish_chunk(pk=chunk.pk, lease=chunk.lease, outcome=outcome_of(chunk), now=now)
    assert set(report.chunks.values_list("state", flat=True)) == {"stopped"}
    assert not stop_report(report=report, now=now)
    assert not ReportLap.objects.exclude(complete=None).exists()


def test_driven_again_it_is_the_same_report(alice, now):
    first = drive(a_report(alice, now, seed=3, direction="cw"), now)
    second = drive_report_again(report=first, now=now)
    assert second.pk != first.pk and drive(second, now).runs_sha256 == first.runs_sha256
    delete_model(model=first.model, now=now)
    with pytest.raises(UserFault) as refused:
        drive_report_again(report=first, now=now)
    assert refused.value.code == "report_model_gone"


def test_a_deleted_report_leaves_no_laps_and_counts_for_a_day(alice, now):
    report = a_report(alice, now)
    with pytest.raises(UserFault) as refused:
        delete_report(report=report, now=now)
    assert refused.value.code == "report_under_way"
    drive(report, now)
    delete_report(report=report, now=now)
    delete_report(report=report, now=now)
    assert not ReportLap.objects.exists() and not ReportChunk.objects.exists()
    assert not reports_visible_to(alice).exists() and used_by(alice, "reports_a_day", now) == 1
    assert purge_reports(now=now) == 0
    assert purge_reports(now=now + timedelta(days=1)) == 1


def test_a_model_with_a_report_is_not_purged(alice, now):
    report = drive(a_report(alice, now), now)
    delete_model(model=report.model, now=now)
    purge_garages(now=now + timedelta(days=3))
    assert CarReport.objects.get().model.network_id
    delete_report(report=report, now=now)
    purge_reports(now=now + timedelta(days=3))
    purge_garages(now=now + timedelta(days=3))
    assert not type(report.model).objects.exists()


# --- quotas


@pytest.mark.parametrize(
    ("setting", "code"),
    [
        ("REPORTS_AT_ONCE", "reports_at_once"),
        ("REPORTS_A_DAY", "reports_a_day"),
        ("REPORTS_PER_RACER", "reports_kept"),
    ],
)
def test_a_full_quota_refuses_and_queues_nothing(alice, bob, now, settings, setting, code):
    setattr(settings, setting, 1)
    a_report(alice, now)
    with pytest.raises(UserFault) as refused:
        a_report(alice, now)
    assert refused.value.code == code and refused.value.params == {"limit": 1}
    assert CarReport.objects.count() == 1
    a_report(bob, now)


def test_what_a_quota_counts(alice, now):
    done, waiting = (a_report(alice, now) for _ in range(2))
    CarReport.objects.filter(pk=done.pk).update(
        state="failed", reason_code="policy_memory", ended_at=now, started_at=now
    )
    assert used_by(alice, quotas.AT_ONCE.name, now) == 1
    stop_report(report=waiting, now=now)  # before it began
    assert used_by(alice, quotas.DAILY.name, now) == 1
    CarReport.objects.filter(pk=done.pk).update(reason_code="platform_gave_up", reason_params={"attempts": 5})
    assert used_by(alice, quotas.DAILY.name, now) == 0
    assert used_by(alice, quotas.KEPT.name, now) == 2


# --- who


def test_predicates_and_their_twins(alice, bob, now):
    staff, report = a_racer("steward", is_staff=True), a_report(alice, now)
    everybody = [alice, bob, staff, AnonymousUser()]
    assert [can_see_report(who, report) for who in everybody] == [True, False, True, False]
    assert [is_report_of(who, report) for who in everybody] == [True, False, False, False]
    assert [can_stop_report(who, report) for who in everybody] == [True, False, True, False]
    for deleted in (False, True):
        if deleted:
            drive(report, now)
            assert not can_stop_report(alice, report)
            delete_report(report=report, now=now)
            report.refresh_from_db()
        for who in everybody:
            assert (report in reports_visible_to(who)) == can_see_report(who, report)
            assert (report in selectors.reports_of(who)) == is_report_of(who, report)


# --- what it comes to


def test_figures_by_track_and_kind(alice, now):
    report = drive(a_report(alice, now), now, off_the_road(39, 99))
    figures = figures_of(report)
    assert [(row.track.slug, [lap.time_ms for lap in row.laps]) for row in figures.tracks] == [("oval", [9000, 9001])]
    assert (figures.complete, figures.on_tracks, report.grade) == (2, 2, "A")
    kinds = {one.kind: (one.completed, one.copes_percent) for one in figures.robustness.kinds}
    assert kinds == {"start": (20, 100), "light": (19, 95), "colours": (20, 100), "sensors": (20, 100), "all": (19, 95)}
    assert figures.robustness.overall.share == 98


def test_a_report_on_tracks_alone_has_no_grade(alice, now):
    report = drive(a_report(alice, now, variations_on=None), now)
    assert (report.state, report.grade) == (State.FINISHED, "") and figures_of(report).robustness is None


@pytest.mark.parametrize(
    "columns",
    [
        {"state": "finished", "ended_at": "now"},
        {"state": "failed", "ended_at": "now"},
        {"state": "stopped"},
        {"deleted_at": "now"},
        {"variations_on": None},
        {"grade": "A"},
        {"seed": 2**31},
    ],
)
def test_the_database_refuses_what_cannot_be(alice, now, columns):
    report = a_report(alice, now)
    told = {name: now if value == "now" else value for name, value in columns.items()}
    with pytest.raises(IntegrityError), transaction.atomic():
        CarReport.objects.filter(pk=report.pk).update(**told)


def test_a_lap_is_driven_or_not(alice, now):
    lap = a_report(alice, now).laps.first()
    with pytest.raises(IntegrityError), transaction.atomic():
        ReportLap.objects.filter(pk=lap.pk).update(complete=True)
    assert not finish_chunk(pk=lap.chunk_id, lease=uuid.uuid4(), outcome=outcome_of(lap.chunk, came_round), now=now)

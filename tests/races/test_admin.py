"""The admin site of races, entries, submissions and tracks."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth.models import Permission
from django.core.files.uploadedfile import SimpleUploadedFile
from django.urls import reverse
from django.utils import timezone

from accounts.models import Racer
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import by_slug
from paddock.geometry.files import write_npy
from races.entries.services.submissions import submit_model
from races.models import Entry, Race, Submission
from tests.factories import a_model, a_race, a_racer, a_track, drive, fail, laps
from tracks.models import Track

pytestmark = pytest.mark.django_db


@pytest.fixture
def now():
    """Pages read the clock, so these tests do too."""
    return timezone.now().replace(microsecond=0)


@pytest.fixture
def boss(client):
    """A superuser who is logged in."""
    client.force_login(Racer.objects.create_superuser("boss", "boss@example.org", None))
    return client


def form(now, **fields) -> dict:
    def two(name: str, time) -> dict:
        return {f"{name}_0": f"{time:%Y-%m-%d}", f"{name}_1": f"{time:%H:%M:%S}"}

    data = {
        "name": "December",
        "slug": "",
        "kind": "league",
        "division": "open",
        "description": "",
        "track": a_track().pk,
        "direction": "ccw",
        "race_type": "time_trial",
        "sensors": ["FRONT_FACING_CAMERA"],
        "ranking_method": "average",
        "laps": "3",
        "minimum_laps": "3",
        "off_track_penalty_ms": "3000",
        "collision_penalty_ms": "5000",
        "max_resets": "10000",
        "max_simulated_ms": "180000",
        "max_submissions": "50",
        "random_boxes": "0",
        "box_distance_m": "2",
        "bots": "0",
        "bot_speed_mps": "1",
        "duel_cars": "2",
        "seed": "0",
        "visibility": "public",
    }
    opens, closes = fields.pop("opens_at", now + timedelta(days=1)), fields.pop("closes_at", now + timedelta(days=9))
    return data | two("opens_at", opens) | two("closes_at", closes) | fields


def add(boss, data):
    return boss.post(reverse("admin:races_race_add"), data)


def errors(response) -> dict:
    assert response.status_code == 200, "the form comes back"
    return {
        field: [e.code for e in each.as_data()] for field, each in response.context["adminform"].form.errors.items()
    }


def change(race: Race) -> str:
    return reverse("admin:races_race_change", args=[race.pk])


def act(client, model: str, action: str, *rows, **data):
    selected = {"action": action, "_selected_action": [row.pk for row in rows]}
    return client.post(
        reverse(f"admin:{'videos' if model == 'video' else 'races'}_{model}_changelist"), selected | data, follow=True
    )


def test_an_admin_schedules_a_league_race(boss, now):
    assert add(boss, form(now)).status_code == 302
    race = Race.objects.get()
    assert (race.slug, race.kind, race.division, race.sensors) == (
        "december",
        "league",
        "open",
        ["FRONT_FACING_CAMERA"],
    )
    assert race.opens_at == now + timedelta(days=1)


def test_errors_are_shown_once_on_their_field_in_words(boss, now):
    wrong = {
        "closes_before": ({"closes_at": now}, {"closes_at": ["race_closes_before_opening"]}),
        "no_division": ({"division": ""}, {"division": ["race_needs_division"]}),
        "too many": ({"minimum_laps": "4"}, {"minimum_laps": ["race_minimum_laps"]}),
        "total": ({"ranking_method": "total", "laps": "5"}, {"minimum_laps": ["race_total_needs_all_laps"]}),
        "secret": ({"visibility": "invitation"}, {"visibility": ["race_league_is_public"]}),
        "over": (
            {"opens_at": now - timedelta(days=9), "closes_at": now - timedelta(days=1)},
            {"closes_at": ["race_already_over"]},
        ),
        "laps": ({"laps": "21"}, {"laps": ["max_value"]}),
    }
    for name, (fields, expected) in wrong.items():
        response = add(boss, form(now, **fields))
        assert errors(response) == expected, name
        assert "Constraint" not in response.content.decode()
    assert not Race.objects.exists()


def test_an_admin_schedules_a_race_with_boxes(boss, now):
    boxes = {"boxes-1-percent": "25", "boxes-1-lane": "inner", "boxes-2-percent": "60", "boxes-2-lane": "outer"}
    assert add(boss, form(now, race_type="object_avoidance", **boxes)).status_code == 302
    race = Race.objects.get()
    assert race.boxes == [{"fraction": 0.25, "lane": "inner"}, {"fraction": 0.6, "lane": "outer"}]
    page = boss.get(change(race)).content.decode()
    assert 'name="boxes-2-percent" value="60"' in page
    close = form(now, race_type="object_avoidance", **(boxes | {"boxes-2-percent": "25.5"}))
    assert errors(boss.post(change(race), close)) == {"boxes": ["boxes_overlap"]}
    mixed = form(now, race_type="head_to_head", opponents="bots", bots="9", **boxes)
    assert errors(boss.post(change(race), mixed)) == {"boxes": ["race_has_no_boxes"], "bots": ["race_bot_count"]}


def test_fixed_fields_cannot_be_edited(boss, now):
    race = a_race(now, opens_at=now + timedelta(hours=1))

    def editable() -> set[str]:
        return set(boss.get(change(race)).context["adminform"].form.fields)

    assert {"laps", "track", "opens_at", "closes_at", "name"} <= editable()
    assert not {"slug", "kind", "organiser", "cancelled_at", "invitation"} & editable()
    Race.objects.update(opens_at=now - timedelta(hours=1))
    assert "opens_at" not in editable() and "laps" in editable()
    racer = a_racer()
    submit_model(race=Race.objects.get(), racer=racer, model=a_model(racer), now=now)
    assert not {"laps", "track", "ranking_method", "seed", "sensors"} & editable()
    assert {"closes_at", "max_submissions", "name"} <= editable()
    Race.objects.update(closes_at=now - timedelta(minutes=1))
    assert editable() == {"name", "description", "edition"}


def test_a_forged_form_changes_no_fixed_field(boss, now):
    race = a_race(now, name="Fixed")
    racer = a_racer()
    submit_model(race=race, racer=racer, model=a_model(racer), now=now)
    data = form(now, name="Renamed", laps="9", minimum_laps="1", slug="other", closes_at=race.closes_at)
    assert boss.post(change(race), data).status_code == 302
    stored = Race.objects.get()
    assert (stored.name, stored.laps, stored.slug, stored.kind) == ("Renamed", 3, race.slug, "community")


def test_a_change_is_checked_like_a_new_race(boss, now):
    race = a_race(now, kind="league", division="open", opens_at=now + timedelta(days=1))
    response = boss.post(change(race), form(now, opens_at=now - timedelta(days=2)))
    assert errors(response) == {"opens_at": ["race_opens_in_the_past"]}
    assert boss.post(change(race), form(now, laps="5")).status_code == 302
    assert Race.objects.get().laps == 5


def test_cancelling_needs_a_reason_and_explains_consequences(boss, now):
    race = a_race(now)
    page = act(boss, "race", "cancel", race)
    assert "are stopped" in page.content.decode() and 'name="reason"' in page.content.decode()
    assert act(boss, "race", "cancel", race, reason="  ").status_code == 422
    assert Race.objects.get().cancelled_at is None
    act(boss, "race", "cancel", race, reason="The track is flooded.")
    assert Race.objects.get().cancel_reason == "The track is flooded."
    page = act(boss, "race", "cancel", race, reason="Again")
    assert "was cancelled: The track is flooded." in page.content.decode()


def test_an_admin_clones_a_race_to_the_next_month(boss, now):
    race = a_race(now, kind="league", division="pro", laps=5)
    act(boss, "race", "clone", race)
    clone = Race.objects.exclude(pk=race.pk).get()
    assert (clone.division, clone.laps) == ("pro", 5)
    assert clone.opens_at > race.opens_at + timedelta(days=27)


def test_a_race_with_entries_cannot_be_deleted(boss, now):
    race, empty = a_race(now), a_race(now)
    drive(race, a_racer(), laps(9_000, 9_000, 9_000), now)
    delete = [reverse("admin:races_race_delete", args=[each.pk]) for each in (race, empty)]
    assert boss.post(delete[0], {"post": "yes"}).status_code == 403
    assert boss.post(delete[1], {"post": "yes"}).status_code == 302
    assert list(Race.objects.all()) == [race]


def test_an_admin_replaces_an_invitation_link(boss, now):
    race = a_race(now, visibility="invitation", organiser=a_racer())
    old = race.invitation
    assert old in boss.get(change(race)).content.decode()
    act(boss, "race", "new_invitations", race)
    assert Race.objects.get().invitation != old


def test_results_are_read_only(boss, now):
    submission = drive(a_race(now), a_racer(), laps(9_000, 9_000, 9_000), now)
    for model, row in (("entry", submission.entry), ("submission", submission)):
        address = reverse(f"admin:races_{model}_change", args=[row.pk])
        assert not boss.get(address).context["adminform"].form.fields
        assert boss.post(address, {"score_ms": "1"}).status_code == 403
        assert boss.get(reverse(f"admin:races_{model}_add")).status_code == 403
        assert boss.post(reverse(f"admin:races_{model}_delete", args=[row.pk]), {"post": "yes"}).status_code == 403


def test_a_steward_removes_and_restores_a_racer(boss, now):
    entry = drive(a_race(now), a_racer("rascal"), laps(9_000, 9_000, 9_000), now).entry
    assert "rascal" in act(boss, "entry", "remove", entry).content.decode()
    act(boss, "entry", "remove", entry, reason="Not their car.")
    entry.refresh_from_db()
    assert entry.removal_reason == "Not their car." and entry.is_withdrawn
    listed = boss.get(reverse("admin:races_entry_changelist") + "?left=removed").content.decode()
    assert "rascal" in listed
    act(boss, "entry", "restore", entry)
    entry.refresh_from_db()
    assert entry.removed_at is None and not entry.is_withdrawn


def test_an_admin_requeues_a_failed_run(boss, now):
    race, racer = a_race(now), a_racer()
    submission = submit_model(race=race, racer=racer, model=a_model(racer), now=now)
    assert "Only failed or stopped runs" in act(boss, "submission", "repeat", submission).content.decode()
    fail(submission, PlatformFault("internal_error"), now)
    act(boss, "submission", "repeat", submission)
    assert Submission.objects.filter(evaluation__state="queued").count() == 1


def test_an_admin_without_permission_cannot_act(client, now):
    viewer = a_racer("viewer", is_staff=True)
    viewer.user_permissions.set(Permission.objects.filter(codename__startswith="view_"))
    client.force_login(viewer)
    race = a_race(now)
    entry = drive(race, a_racer(), laps(9_000, 9_000, 9_000), now).entry
    act(client, "race", "cancel", race, reason="No.")
    act(client, "race", "clone", race)
    act(client, "entry", "remove", entry, reason="No.")
    assert Race.objects.get().cancelled_at is None
    assert Entry.objects.get().removed_at is None


def test_an_admin_imports_a_track_and_sees_it_drawn(boss):
    file = SimpleUploadedFile("oval.npy", write_npy(by_slug("oval").geometry()))
    data = {"name": "My oval", "slug": "", "description": "Round.", "file": file}
    assert boss.post(reverse("admin:tracks_track_add"), data).status_code == 302
    track = Track.objects.get()
    assert (track.slug, track.description, track.owner.alias) == ("my-oval", "Round.", "boss")
    address = reverse("admin:tracks_track_change", args=[track.pk])
    assert "data:image/svg+xml" in boss.get(address).content.decode()
    assert boss.post(address, {"name": "Our oval", "description": "", "length_m": "1"}).status_code == 302
    track.refresh_from_db()
    assert track.name == "Our oval" and track.length_m > 17


def test_an_invalid_track_file_is_reported_in_the_form(boss):
    data = {"name": "Bad", "slug": "", "description": "", "file": SimpleUploadedFile("bad.npy", b"nothing")}
    response = boss.post(reverse("admin:tracks_track_add"), data)
    assert errors(response) == {"file": ["track_not_npy"]}
    assert not Track.objects.exists()


def test_raced_and_catalogue_tracks_cannot_be_deleted(boss, now):
    a_race(now)
    track = Track.objects.get()
    assert boss.post(reverse("admin:tracks_track_delete", args=[track.pk]), {"post": "yes"}).status_code == 403
    Race.objects.all().delete()
    assert boss.post(reverse("admin:tracks_track_delete", args=[track.pk]), {"post": "yes"}).status_code == 403


def test_a_stale_form_is_refused(boss, now):
    race = a_race(now, kind="league", division="open", opens_at=now + timedelta(days=1))
    seen = boss.get(change(race)).context["adminform"].form.initial["edition"]
    Race.objects.update(max_submissions=3)
    response = boss.post(change(race), form(now, laps="5", edition=seen))
    assert errors(response) == {"__all__": ["race_changed_meanwhile"]}
    assert (Race.objects.get().laps, Race.objects.get().max_submissions) == (3, 3)
    seen = boss.get(change(race)).context["adminform"].form.initial["edition"]
    assert boss.post(change(race), form(now, laps="5", edition=seen)).status_code == 302
    assert Race.objects.get().laps == 5


def test_a_refused_change_is_not_reported_as_made(boss, now, monkeypatch):
    def refused(**_):
        raise UserFault("race_changed_meanwhile")

    monkeypatch.setattr("races.pages.services.edit_race", refused)
    race = a_race(now, kind="league", division="open", opens_at=now + timedelta(days=1))
    answer = boss.post(change(race), form(now, laps="5"), follow=True)
    (said,) = answer.context["messages"]
    assert said.level_tag == "error"


def test_an_admin_stops_videos_and_deletes_them_with_their_files(boss, now, video_wakes, commits):
    from videos.models import Video
    from videos.services import request_video, run_next_video

    run = drive(a_race(now), a_racer(), laps(9_000, 9_100, 9_200), now).evaluation
    for part in ("1", "2"):
        request_video(evaluation=run, by=run.owner, part=part, language="en", now=now)
        if part == "1":
            run_next_video(worker="w")
    ready, waiting = Video.objects.order_by("part")
    page = boss.get(reverse("admin:videos_video_change", args=[ready.pk])).content.decode()
    assert ready.public_id in page and 'name="state"' not in page
    assert boss.get(reverse("admin:videos_video_add")).status_code == 403
    assert "1 video was stopped." in act(boss, "video", "stop", ready, waiting).content.decode()
    waiting.refresh_from_db()
    assert (waiting.state, waiting.reason_code) == ("failed", "video_stopped")
    act(boss, "video", "delete_selected", ready, waiting, post="yes")
    assert not Video.objects.exists()
    assert not ready.file.storage.exists(ready.file.name)

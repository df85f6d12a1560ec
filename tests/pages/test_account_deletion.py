"""A deleted account: the name is nowhere, results and what they need stay, files go."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.admin.models import LogEntry
from django.contrib.sessions.models import Session
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.urls import reverse

from accounts.class_accounts.services import make_class
from accounts.groups.services import ask_to_join, confirm_member, make_group
from accounts.leaving.services import delete_account
from accounts.models import DeletedAccount, Racer, RacerGroup
from accounts.signing_in.reserved_aliases import is_reserved, is_taken
from accounts.teams.services import found_team, join_by_link
from accounts.tokens.services import create_token
from core.personal_data.discarding import delete_discarded, discard_files
from core.personal_data.models import DiscardedFile
from evaluation.models import Evaluation, Network, TrainedModel
from league.models import Notice
from paddock.errors import UserFault
from races.models import Entry, Race, Submission
from races.test_runs.services import drive_own
from tests.accounts.leavers import tables_with
from tests.clients import logged_in
from tests.drawn_runs import a_drawing
from tests.factories import a_model, a_race, a_racer
from tests.pages.form_world import Cast
from videos import drawing

NAMELESS = "deleted-racer-%d"


@pytest.fixture
def cast(world, wakes, monkeypatch):
    monkeypatch.setattr(drawing, "write_video", a_drawing)
    monkeypatch.setattr(drawing, "poster", lambda scene: b"a still")
    return Cast(world)


def hand_over(alice: Racer, to: Racer) -> None:
    """What alice must do before she can leave."""
    Race.objects.filter(organiser=alice).update(organiser=to)
    RacerGroup.objects.filter(leader=alice).update(leader=to)


def test_no_table_has_the_name_or_an_address_afterwards(world, cast, django_capture_on_commit_callbacks):
    alice, bob = Racer.objects.get(alias="alice"), Racer.objects.get(alias="bob")
    logged_in(alice), logged_in(bob)
    hand_over(alice, world.admin)
    assert {one.split(".")[0] for one in tables_with("alice")} >= {"accounts_racer", "account_emailaddress"}
    with django_capture_on_commit_callbacks(execute=True):
        for racer in (alice, bob):
            delete_account(racer=racer, by=racer, now=world.now)
    assert tables_with("alice", "bob", "alice@example.org", "bob@example.org") == []
    assert not Session.objects.exists()
    assert DeletedAccount.objects.count() == 2 and not DiscardedFile.objects.exists()


def test_the_board_keeps_the_result_without_the_name(world, client, wakes):
    bob = Racer.objects.get(alias="bob")
    entry = Entry.objects.get(race=world.race, racer=bob)
    delete_account(racer=bob, by=bob, now=world.now)
    after = Entry.objects.get(pk=entry.pk)
    assert after.score_ms == entry.score_ms and after.rank_key == entry.rank_key
    for language, name in (("en", f"Deleted racer {bob.pk}"), ("ko", f"탈퇴한 레이서 {bob.pk}")):
        page = client.get(world.race.get_absolute_url(), headers={"accept-language": language}).content.decode()
        assert name in page and "bob" not in page
    assert client.get(reverse("racer", args=["bob"])).status_code == 404
    assert client.get(reverse("racer", args=[NAMELESS % bob.pk])).status_code == 404


def test_files_go_after_the_commit_but_those_of_runs_in_races(world, wakes, django_capture_on_commit_callbacks):
    bob = Racer.objects.get(alias="bob")
    upload = default_storage.save("uploads/bobs", ContentFile(b"an upload"))
    unused = a_model(bob)
    TrainedModel.objects.filter(pk=unused.pk).update(source_file=upload)
    raced = list(Submission.objects.filter(entry__racer=bob).values_list("network__onnx", flat=True))
    with django_capture_on_commit_callbacks(execute=True):
        delete_account(racer=bob, by=bob, now=world.now)
        assert default_storage.exists(upload)
    assert not default_storage.exists(upload) and not default_storage.exists(unused.network.onnx.name)
    assert raced and all(default_storage.exists(name) for name in raced)
    kept = TrainedModel.objects.filter(owner=bob)
    assert kept and {(one.name, one.description, one.source_file.name) for one in kept} == {("deleted", "", "")}


def test_private_runs_go_and_runs_in_races_stay(world, wakes):
    bob = Racer.objects.get(alias="bob")
    own = drive_own(owner=bob, model=a_model(bob), track=world.track, now=world.now).evaluation
    in_races = set(Evaluation.objects.filter(owner=bob).exclude(pk=own.pk).values_list("pk", flat=True))
    delete_account(racer=bob, by=bob, now=world.now)
    assert set(Evaluation.objects.filter(owner=bob).values_list("pk", flat=True)) == in_races


def test_a_crash_before_the_files_went_is_swept_later(db, now):
    left = default_storage.save("uploads/left", ContentFile(b"left"))
    discard_files([left], now=now)
    assert default_storage.exists(left) and delete_discarded() == 1
    assert not default_storage.exists(left) and not DiscardedFile.objects.exists()


def test_a_discarded_file_that_a_row_has_again_stays(db, now):
    model = a_model(a_racer())
    name = default_storage.save(model.network.onnx.name, ContentFile(b"x"))
    Network.objects.filter(pk=model.network_id).update(onnx=name)
    discard_files([name], now=now)
    assert delete_discarded() == 0 and default_storage.exists(name) and not DiscardedFile.objects.exists()


def test_an_entry_without_a_result_leaves_an_open_race(db, now, wakes):
    race, racer = a_race(now), a_racer("passing")
    Entry.objects.create(race=race, racer=racer, entered_at=now)
    delete_account(racer=racer, by=racer, now=now)
    assert not race.entries.exists()


def test_names_that_other_rows_quote_are_replaced(db, now, wakes):
    one, other = a_racer("quoted"), a_racer("reader")
    notice = Notice.objects.create(
        racer=other, kind="opens", about="x", params={"leader": "quoted", "race": "unquoted"}, at=now
    )
    entry = LogEntry.objects.create(
        user=other,
        object_repr="quoted",
        action_flag=2,
        change_message='[{"changed": {"object": "quoted@example.org"}}]',
    )
    delete_account(racer=one, by=other, now=now)
    notice.refresh_from_db(), entry.refresh_from_db()
    assert notice.params == {"leader": NAMELESS % one.pk, "race": "unquoted"}
    assert entry.object_repr == NAMELESS % one.pk and "quoted" not in entry.change_message


def test_address_is_free_and_alias_reserved_for_a_time(db, now, settings, wakes):
    racer = a_racer("wanted")
    delete_account(racer=racer, by=racer, now=now)
    assert not Racer.objects.filter(email="wanted@example.org").exists()
    assert is_taken("Wanted", now) and is_taken("wan-ted", now)
    assert not is_taken("wanted", now + timedelta(days=settings.ALIAS_RESERVED_DAYS))
    assert is_reserved("deleted-racer-7") and is_reserved("Deleted_Racer-x")


@pytest.mark.parametrize(
    ("code", "prepare"),
    [
        ("account_organises", lambda racer, now: a_race(now, organiser=racer)),
        ("account_leads_group", lambda racer, now: a_group_with_a_member(racer, now)),
        ("account_leads_class", lambda racer, now: make_class(teacher=racer, name="7c", plan=[], now=now)),
        ("account_last_admin", lambda racer, now: Racer.objects.filter(pk=racer.pk).update(is_superuser=True)),
        ("account_not_deletable", lambda racer, now: Racer.objects.filter(pk=racer.pk).update(is_house=True)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_racer_with_something_to_hand_over_is_refused(code, prepare, db, now, wakes):
    racer = a_racer()
    prepare(racer, now)
    with pytest.raises(UserFault) as refused:
        delete_account(racer=racer, by=racer, now=now)
    assert refused.value.code == code and Racer.objects.get(pk=racer.pk).alias == racer.alias


def a_group_with_a_member(leader: Racer, now):
    group = make_group(by=leader, name="Crew", now=now)
    member = ask_to_join(code=group.code, racer=a_racer(), now=now)
    confirm_member(member=member, by=leader, now=now)


def test_a_captain_leaves_the_team_to_its_eldest_member(db, now, wakes):
    captain, mate = a_racer(), a_racer()
    team = found_team(by=captain, name="Comets", now=now)
    join_by_link(code=team.code, racer=mate, now=now)
    delete_account(racer=captain, by=captain, now=now)
    team.refresh_from_db()
    assert team.captain == mate and team.members.get().racer == mate


def test_a_group_without_others_goes_too(db, now, wakes):
    leader = a_racer()
    make_group(by=leader, name="Alone", now=now)
    delete_account(racer=leader, by=leader, now=now)
    assert not RacerGroup.objects.exists()


def test_an_admin_deletes_a_racer_on_the_page_and_in_the_list(world, wakes, client):
    bob, alice = Racer.objects.get(alias="bob"), Racer.objects.get(alias="alice")
    client = logged_in(world.admin)
    page = f"/admin/accounts/racer/{bob.pk}/delete/"
    assert "bob: all but results" in client.get(page).content.decode()
    client.post(page, {"post": "yes"})
    assert Racer.objects.get(pk=bob.pk).alias == NAMELESS % bob.pk and not bob.deletion.by_racer
    assert tables_with("bob", "bob@example.org") == []
    chosen = {"action": "delete_selected", "_selected_action": [alice.pk], "post": "yes"}
    assert "You organise the race" in client.post("/admin/accounts/racer/", chosen).content.decode()
    hand_over(alice, world.admin)
    client.post("/admin/accounts/racer/", chosen)
    assert Racer.objects.get(pk=alice.pk).alias == NAMELESS % alice.pk


def test_admins_cannot_delete_themselves_nor_house_cars(world, wakes):
    client, house = logged_in(world.admin), Racer.objects.filter(is_house=True).first()
    for racer in (world.admin, house):
        assert client.post(f"/admin/accounts/racer/{racer.pk}/delete/", {"post": "yes"}).status_code == 403
    assert Racer.objects.filter(pk__in=[world.admin.pk, house.pk], deletion=None).count() == 2


def test_a_program_deletes_the_account_with_alias_and_password(db, client, now):
    racer = Racer.objects.create_user("leaver", "leaver@example.org", "correct horse battery")
    _token, text = create_token(racer=racer, now=now)
    header = {"authorization": f"Bearer {text}"}
    sent = {"alias": "leaver", "password": "correct horse battery"}
    for wrong in ({"alias": "Leaver"}, {"password": "another one"}):
        answer = client.post("/api/v1/me/deletion/", sent | wrong, headers=header, content_type="application/json")
        assert answer.status_code in (400, 403) and Racer.objects.filter(alias="leaver").exists()
    answer = client.post("/api/v1/me/deletion/", sent, headers=header, content_type="application/json")
    assert answer.status_code == 204 and racer.deletion.by_racer
    assert client.get("/api/v1/me/", headers=header).status_code == 401
    assert tables_with("leaver", "leaver@example.org") == []

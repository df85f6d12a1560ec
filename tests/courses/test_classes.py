"""Classes: accounts from a list of names, cards, what learners may not do, progress, and deleting it all."""

from __future__ import annotations

import re
from datetime import timedelta

import pytest
from django.core import mail
from django.core.cache import cache
from django.core.files.storage import default_storage
from django.test import Client
from django.utils import timezone

from accounts.class_accounts import services as classes
from accounts.class_accounts.services import (
    add_learners,
    add_teacher,
    can_teach,
    classes_taught_by,
    make_class,
    names_in,
    new_codes,
    note_lesson,
    shown_code,
)
from accounts.groups.services import ask_to_join, delete_group, hand_over_group, remove_member
from accounts.models import ClassLearner, Classroom, GroupMember, Racer, RacerGroup, RacerQuota
from courses.classes.deletion import delete_class
from courses.classes.selectors import progress_of, series_of
from evaluation.garage.services import share_model
from evaluation.models import Evaluation, TrainedModel
from paddock.errors import UserFault
from races.entries.selectors.offers import enterable_now
from races.entries.selectors.visibility import can_see_race
from races.entries.services.entries import enter_race
from races.live.services import launch, prepare_ahead
from races.models import Race, Visibility
from tests.clients import logged_in
from tests.factories import a_model, a_race, a_racer, a_track, drive, laps
from tests.live_shows import a_live_race, a_show, begun, compute, show, slot_of
from tests.training.jobs import a_training
from training.models import TrainingJob

pytestmark = pytest.mark.django_db


def code(call) -> str:
    with pytest.raises(UserFault) as refused:
        call()
    return refused.value.code


@pytest.fixture(autouse=True)
def _fresh(wakes, trainings_taken_on) -> None:
    cache.clear()


@pytest.fixture
def made(alice, now):
    """Alice's class with two learners, and their cards."""
    room = make_class(teacher=alice, name="6a", plan=["agent", "three-ways"], now=now)
    return room, add_learners(classroom=room, by=alice, names=["Kim Minji", "Ann Lee"], now=now)


def test_only_the_teacher_sees_a_class(made, alice, bob):
    room, cards = made
    staff, learner = a_racer(is_staff=True), cards[0].learner.racer
    for viewer, sees in ((None, False), (bob, False), (learner, False), (staff, False), (alice, True)):
        assert can_teach(viewer, room) is sees
        assert classes_taught_by(viewer).filter(pk=room.pk).exists() is sees
        if viewer is not None:
            answer = logged_in(viewer).get(room.get_absolute_url())
            assert (answer.status_code == 200) is sees
    for act in (
        lambda: add_learners(classroom=room, by=bob, names=["x"], now=timezone.now()),
        lambda: new_codes(classroom=room, by=bob),
        lambda: delete_class(classroom=room, by=bob),
    ):
        assert code(act) == "class_not_yours"


def test_real_names_are_seen_by_nobody_else(made, alice, bob):
    room, cards = made
    racer = cards[0].learner.racer
    assert "Kim Minji" in logged_in(alice).get(room.get_absolute_url()).content.decode()
    for client in (Client(), logged_in(bob), logged_in(cards[1].learner.racer), logged_in(a_racer(is_staff=True))):
        for path in (f"/racers/{racer.alias}/", "/groups/", room.group.get_absolute_url(), "/class/"):
            assert "Minji" not in client.get(path).content.decode()
    assert "minji" not in racer.alias.lower() and not racer.has_usable_password()


def test_a_code_is_long_kept_as_a_digest_and_replaced(made, alice):
    room, (card, other) = made
    assert re.fullmatch(r"[A-HJKMNP-Z2-9]{12}", card.code) and card.code not in str(ClassLearner.objects.values())
    browser = Client()
    assert browser.get(f"/class/{card.code}/").wsgi_request.user.is_anonymous, "a link that is fetched logs nobody in"
    page = browser.post("/class/", {"code": shown_code(card.code).lower()}, follow=True).content.decode()
    assert card.learner.racer.alias in page and "Lesson plan" in page
    (new,) = new_codes(classroom=room, by=alice, learners=[card.learner.racer_id])
    assert browser.get("/class/").wsgi_request.user.is_anonymous, "who was logged in is so no more"
    assert Client().post("/class/", {"code": card.code}).status_code == 422
    assert Client().post(f"/class/{card.code}/", {"code": card.code}).status_code == 422, (
        "nor does the link on the card"
    )
    assert Client().post("/class/", {"code": new.code}).status_code == 302
    assert Client().post("/class/", {"code": other.code}).status_code == 302


def test_guesses_are_limited_and_right_codes_are_not_counted(made, monkeypatch):
    _room, (card, _other) = made
    monkeypatch.setattr(classes, "WRONG_CODES", "3/5m")
    for _ in range(5):
        assert Client().post("/class/", {"code": card.code}).status_code == 302
    for number in range(3):
        assert "Unknown code" in Client().post("/class/", {"code": f"AAAABBBBCCC{number}"}).content.decode()
    assert "too many wrong codes" in Client().post("/class/", {"code": card.code}).content.decode()


@pytest.mark.parametrize("text", ["", " \n ", "x" * 81])
def test_what_is_no_list_of_names_is_refused(text):
    assert code(lambda: names_in(text)) == "class_names"


def test_an_invisible_character_in_a_name_is_named_and_adds_nobody(made, alice, now):
    before = Racer.objects.count()
    with pytest.raises(UserFault) as fault:
        add_learners(classroom=made[0], by=alice, names=["Ann", "a\x07b"], now=now)
    assert fault.value.code == "text_character" and fault.value.params == {"character": "U+0007"}
    assert Racer.objects.count() == before


def test_a_teacher_has_so_many_learners_and_a_learner_has_none(made, alice, now):
    room, cards = made
    RacerQuota.objects.create(racer=alice, name="learners", limit=3)
    before = Racer.objects.count()
    assert code(lambda: add_learners(classroom=room, by=alice, names=["a", "b"], now=now)) == "class_too_many"
    assert Racer.objects.count() == before
    pupil = cards[0].learner.racer
    assert code(lambda: make_class(teacher=pupil, name="x", plan=[], now=now)) == "class_no_teacher"
    assert code(lambda: hand_over_group(group=room.group, to=pupil, by=alice)) == "group_is_a_class"
    assert code(lambda: delete_group(group=room.group, by=alice)) == "group_is_a_class"


def test_nobody_leaves_the_group_of_a_class_without_the_class(made, alice, bob, now):
    room, cards = made
    add_teacher(classroom=room, by=alice, alias=bob.alias, now=now)
    for racer in (cards[0].learner.racer, bob, alice):
        member = GroupMember.objects.get(group=room.group, racer=racer)
        for by in (alice, racer):
            assert code(lambda by=by, member=member: remove_member(member=member, by=by)) == "group_is_a_class"
        page = f"/groups/{room.group.slug}/"
        assert f"{page}leave/" not in logged_in(racer).get(page).content.decode()
        assert logged_in(racer).post(f"{page}leave/").status_code == 302
        assert GroupMember.objects.filter(pk=member.pk).exists()
    led = logged_in(alice).get(f"/groups/{room.group.slug}/").content.decode()
    assert [do for do in ("link", "remove", "delete", "hand_over") if f'value="{do}"' in led] == ["link"]
    asked = ask_to_join(code=room.group.code, racer=a_racer(), now=now)
    remove_member(member=asked, by=alice)  # an outsider


def test_a_learner_does_nothing_that_needs_mail(made):
    racer = made[1][0].learner.racer
    pupil = logged_in(racer)
    for path in ("/accounts/email/", "/accounts/password/set/", "/accounts/2fa/", "/settings/tokens/"):
        assert pupil.get(path)["Location"] == "/class/"
    Client().post("/accounts/password/reset/", {"email": racer.email})
    assert not [one for one in mail.outbox if "reset" in one.body and racer.alias in one.body]


def test_a_learner_races_in_the_class_alone_and_shares_nothing(made, alice, now):
    room, cards = made
    racer = cards[0].learner.racer
    public, own = a_race(now), a_race(now, organiser=alice, group=room.group, visibility=Visibility.INVITATION)
    assert code(lambda: enter_race(race=public, racer=racer, now=now)) == "race_not_of_class"
    assert can_see_race(racer, own) and [*enterable_now(now, racer)] == [own]
    enter_race(race=own, racer=racer, now=now)
    assert code(lambda: share_model(model=a_model(racer), now=now)) == "learner_shares_nothing"


def test_the_teacher_sees_how_far_each_is(made, alice, now):
    room, cards = made
    racer = cards[0].learner.racer
    for slug in ("agent", "agent", "reward"):
        note_lesson(racer=racer, slug=slug, now=now)
    note_lesson(racer=alice, slug="agent", now=now)
    race = a_race(now, organiser=alice, group=room.group, visibility=Visibility.INVITATION)
    drive(race, racer, laps(10_000, 9_900, 10_100), now)
    a_training(racer, a_track(), now)
    found = {row.learner.real_name: (row.lessons, row.trainings, row.best_lap_ms) for row in progress_of(room)}
    assert found == {"Ann Lee": (0, 0, None), "Kim Minji": (1, 1, 9_900)}


def test_the_best_lap_is_that_of_the_latest_race(made, alice, now):
    room, cards = made
    racer = cards[0].learner.racer
    fields = {"organiser": alice, "group": room.group, "visibility": Visibility.INVITATION}
    earlier = a_race(now, opens_at=now - timedelta(days=2), **fields)
    later = a_race(now, opens_at=now - timedelta(days=1), off_track_penalty_ms=0, **fields)
    drive(later, racer, laps(12_000, 12_000, 12_000), now)
    drive(earlier, racer, laps(8_000, 8_000, 8_000), now)
    row = next(row for row in progress_of(room) if row.best_lap_ms)
    assert (row.best_lap_ms, row.race) == (12_000, later)


def test_a_class_is_deleted_with_everything(made, alice, bob, now, django_capture_on_commit_callbacks):
    room, cards = made
    race = a_race(now, organiser=alice, group=room.group, visibility=Visibility.INVITATION)
    elsewhere = drive(a_race(now), bob, laps(9_000, 9_000, 9_000), now)
    for card in cards:
        drive(race, card.learner.racer, laps(10_000, 9_900, 10_100), now)
        a_training(card.learner.racer, a_track(), now)
    drive(race, alice, laps(10_400, 9_950, 10_100), now)
    trace = Evaluation.objects.get(owner=cards[0].learner.racer).result.trace.name
    learners = [card.learner.racer_id for card in cards]
    with django_capture_on_commit_callbacks(execute=True):
        assert delete_class(classroom=room, by=alice) == 2
    assert not Racer.objects.filter(pk__in=learners).exists() and not ClassLearner.objects.exists()
    assert not Classroom.objects.exists() and not RacerGroup.objects.exists()
    assert not Race.objects.filter(pk=race.pk).exists() and not TrainingJob.objects.exists()
    for model in (Evaluation, TrainedModel):
        assert set(model.objects.values_list("owner", flat=True)) == {bob.pk, alice.pk}, "the teacher's car stays"
    assert not default_storage.exists(trace)
    assert elsewhere.entry.race.entries.count() == 1


def test_the_pages(alice):
    teacher = logged_in(alice)
    where = teacher.post("/classes/", {"name": "6a", "plan": ["agent"]})["Location"]
    cards = teacher.post(where, {"do": "add", "names": "Kim Minji\nAnn Lee\n"})
    page = cards.content.decode()
    assert page.count("<svg") >= 2 and "Kim Minji" in page and cards["Cache-Control"].find("no-store") >= 0
    assert "one name a line" in teacher.post(where, {"do": "add", "names": "x" * 90}).content.decode()
    page = teacher.post(where, {"do": "codes", "learner": [ClassLearner.objects.first().pk]}).content.decode()
    assert page.count('class="class-card"') == 1
    before = list(ClassLearner.objects.values_list("code_digest", flat=True))
    for ticked in ([], ["", "x", "-1"]):
        answer = teacher.post(where, {"do": "codes", "learner": ticked}, follow=True).content.decode()
        assert "Select learners for new codes." in answer
    assert list(ClassLearner.objects.values_list("code_digest", flat=True)) == before, "nobody's card is worthless now"
    teacher.post(where, {"do": "plan", "plan": ["agent", "nonsense"]})
    assert Classroom.objects.get().plan == ["agent"]
    form = teacher.get(f"/races/new/?group={Classroom.objects.get().group.slug}").content.decode()
    assert re.search(r"<option value=.\d+. selected>6a", form)
    assert "Write the name" in teacher.post(where, {"do": "delete", "confirm": "6b"}, follow=True).content.decode()
    assert "Class deleted" in teacher.post(where, {"do": "delete", "confirm": "6a"}, follow=True).content.decode()
    assert not Racer.objects.filter(email__endswith="@learner.invalid").exists()


def test_cards_that_are_reloaded_or_clicked_twice_make_no_second_class(alice):
    """Reloading the page with the cards sends the form again."""
    teacher = logged_in(alice)
    where = teacher.post("/classes/", {"name": "6a", "plan": ["agent"]})["Location"]

    def form() -> dict[str, str]:
        return {"once": re.findall(r'name="once" value="([^"]+)"', teacher.get(where).content.decode())[0]}

    add = {"do": "add", "names": "\n".join(f"Learner {number}" for number in range(40)), **form()}
    assert teacher.post(where, add).content.decode().count('class="class-card"') == 40
    again = teacher.post(where, add, follow=True)
    assert "This was done already." in again.content.decode() and ClassLearner.objects.count() == 40
    digests = set(ClassLearner.objects.values_list("code_digest", flat=True))
    codes = {"do": "all-codes", **form()}
    teacher.post(where, codes)
    printed = set(ClassLearner.objects.values_list("code_digest", flat=True))
    assert not digests & printed
    teacher.post(where, codes)
    assert set(ClassLearner.objects.values_list("code_digest", flat=True)) == printed, "the cards on paper still log in"
    # what was refused may be sent again, mended
    refused = {"do": "add", "names": "x" * 90, **form()}
    assert teacher.post(where, refused).status_code == 422
    assert teacher.post(where, refused | {"names": "Kim Minji"}).status_code == 200
    assert ClassLearner.objects.count() == 41


def test_a_class_whose_race_is_live_is_deleted_too(alice, now, django_capture_on_commit_callbacks):
    """A run that is played, one that is computed and sealed, and one that waits for a worker."""
    room = make_class(teacher=alice, name="6a", plan=[], now=now)
    cards = add_learners(classroom=room, by=alice, names=["Kim", "Ann", "Lee", "Pat"], now=now)
    race = a_live_race(now, alice, group=room.group, visibility=Visibility.INVITATION)
    names = [card.learner.racer.alias for card in cards]
    event = begun(a_show(now, alice, names, race=race, order="as_entered", speed_control=True), alice, now)
    for name in names[:2]:
        compute(slot_of(event, name), now, 9_000)
    show(event, slot_of(event, names[0]), alice, now)
    prepare_ahead(event=event, now=now)
    compute(slot_of(event, names[2]), now, 9_000)
    launch(event=event, by=alice, seen=None, now=now)
    with django_capture_on_commit_callbacks(execute=True):
        assert delete_class(classroom=room, by=alice) == 4
    assert not Evaluation.with_sealed.exists() and not Race.objects.exists()
    assert not Racer.objects.filter(alias__in=names).exists()


def test_a_class_has_a_series_of_its_races(alice, made, now):
    """Points by place; a race that is open counts as it stands, one that was called off or is to come does not."""
    room, cards = made
    kim, ann = (card.learner.racer for card in cards)
    fields = {"organiser": alice, "group": room.group, "visibility": Visibility.INVITATION}
    over, open_ = a_race(now, slug="first", **fields), a_race(now + timedelta(seconds=1), slug="second", **fields)
    later = now + timedelta(minutes=1)
    for race, times in ((over, (10_000, 11_000)), (open_, (12_000, 11_500))):
        for racer, time_ms in zip((kim, ann), times, strict=True):
            drive(race, racer, laps(*[time_ms] * 3), later)
    drive(open_, alice, laps(*[9_000] * 3), later)
    Race.objects.filter(pk=over.pk).update(closes_at=later)
    a_race(now, slug="called-off", cancelled_at=now, cancel_reason="Rain", **fields)
    series = series_of(room, later + timedelta(seconds=1))
    assert [race.slug for race in series.races] == ["first", "second"] and series.is_provisional
    found = [(row.place, row.racer, row.points, row.cells) for row in series.rows]
    assert found == [(1, kim, 25 + 15, [1, 3]), (2, ann, 18 + 18, [2, 2]), (3, alice, 25, [None, 1])]
    assert [row.points for row in series_of(room, later, without=[open_.pk]).rows] == [25, 18]
    for reader in (kim, alice):
        where = room.get_absolute_url() if reader == alice else "/class/"
        page = logged_in(reader).get(where).content.decode().partition('id="series"')[2]
        assert page.index(kim.alias) < page.index(ann.alias)
        assert "Kim Minji" not in page


def test_equals_share_their_place_in_the_series(alice, made, now):
    room, cards = made
    fields = {"organiser": alice, "group": room.group, "visibility": Visibility.INVITATION}
    for number, order in enumerate(((0, 1), (1, 0))):
        race = a_race(now, slug=f"race-{number}", **fields)
        for place, at in enumerate(order):
            drive(race, cards[at].learner.racer, laps(*[10_000 + 500 * place] * 3), now)
    assert [(row.place, row.points) for row in series_of(room, now).rows] == [(1, 43), (1, 43)]


def test_a_class_is_made_once_however_often_it_is_clicked(alice):
    teacher = logged_in(alice)
    once = re.findall(r'name="once" value="([^"]+)"', teacher.get("/classes/").content.decode())[0]
    sent = {"name": "6a", "plan": ["agent"], "once": once}
    assert teacher.post("/classes/", sent | {"name": ""}).status_code == 422
    assert teacher.post("/classes/", sent)["Location"] == Classroom.objects.get().get_absolute_url()
    assert teacher.post("/classes/", sent)["Location"] == "/classes/" and Classroom.objects.count() == 1

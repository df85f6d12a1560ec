"""One car, one place: whoever sent a car to a race first keeps it, unless the race lets racers share cars."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import IntegrityError, transaction
from django.test import Client

from evaluation.models import TrainedModel
from evaluation.running.queue.jobs import finish_evaluation
from evaluation.running.queue.services import stop_evaluation
from paddock.errors import UserFault
from races.boards.selectors.board import board
from races.entries.selectors.cars import shared_cars
from races.entries.services.cars import settle_cars
from races.entries.services.entries import enter_race, remove_entry, withdraw
from races.entries.services.submissions import submit_model
from races.models import Entry, Race, RaceCar, RefusedCar, Submission
from races.pages.services import edit_race
from races.test_runs.services import drive_own
from tests.factories import a_model, a_race, a_racer, drive, finish, laps, outcome, start

pytestmark = pytest.mark.django_db
HOUR = timedelta(hours=1)
LAPS = laps(9_000, 9_000, 9_000)


def a_copy(racer, model: TrainedModel) -> TrainedModel:
    """The same network in another garage."""
    if racer == model.owner:
        return model
    copy = a_model(racer)
    TrainedModel.objects.filter(pk=copy.pk).update(network=model.network)
    return TrainedModel.objects.get(pk=copy.pk)


def answering(model: TrainedModel, answers: str) -> TrainedModel:
    model.network.facts = {"bound": None, "shapes": {}, "answers": answers * 64}
    model.network.save()
    return model


def refused(**submission) -> UserFault:
    with pytest.raises(UserFault) as caught:
        submit_model(**submission)
    assert caught.value.code == "car_of_another"
    return caught.value


def ranks(race: Race) -> dict[str, int | None]:
    return {row.alias: row.rank for row in board(race).rows}


def as_before_the_rule(race: Race, racer, model, now) -> Submission:
    """What a version without the rule let through: the second with the same car."""
    Race.objects.filter(pk=race.pk).update(shared_cars=True)
    race.refresh_from_db()
    sent = submit_model(race=race, racer=racer, model=model, now=now)
    finish(sent, LAPS, now)
    Race.objects.filter(pk=race.pk).update(shared_cars=False)
    race.refresh_from_db()
    return sent


class TestSubmitting:
    def test_a_second_copy_of_a_network_is_refused_naming_the_first(self, alice, bob, now):
        race = a_race(now)
        first = drive(race, alice, LAPS, now)
        fault = refused(race=race, racer=bob, model=a_copy(bob, first.evaluation.model), now=now)
        assert fault.params == {"racer": "alice"} and "alice" in str(fault)
        assert ranks(race) == {"alice": 1}, "who was refused is not entered either"

    def test_a_network_with_the_same_answers_is_the_same_car(self, alice, bob, now):
        race = a_race(now)
        submit_model(race=race, racer=alice, model=answering(a_model(alice), "a"), now=now)
        refused(race=race, racer=bob, model=answering(a_model(bob), "a"), now=now)
        assert submit_model(race=race, racer=bob, model=answering(a_model(bob), "b"), now=now)

    def test_a_racer_may_resend_a_car_that_answers_like_their_own(self, alice, now):
        race = a_race(now)
        finish(submit_model(race=race, racer=alice, model=answering(a_model(alice), "a"), now=now), LAPS, now)
        assert submit_model(race=race, racer=alice, model=answering(a_model(alice), "a"), now=now)

    def test_sharing_cars_is_a_rule_fixed_by_the_first_submission(self, alice, bob, now):
        race = a_race(now, shared_cars=True, organiser=alice)
        first = drive(race, alice, LAPS, now)
        assert submit_model(race=race, racer=bob, model=a_copy(bob, first.evaluation.model), now=now)
        with pytest.raises(UserFault) as caught:
            edit_race(race=race, now=now, shared_cars=False)
        assert "shared_cars" in caught.value.errors.error_dict

    @pytest.mark.parametrize("answers", [None, "a"])
    def test_sending_a_shared_car_first_does_not_shut_out_its_owner(
        self, alice, bob, now, answers, django_capture_on_commit_callbacks
    ):
        race, mine = a_race(now), a_model(alice)
        if answers:
            copy = answering(a_model(bob), answers)
            answering(mine, answers)
        else:
            copy = a_copy(bob, mine)
        finish(submit_model(race=race, racer=bob, model=copy, now=now), LAPS, now)
        assert ranks(race) == {"bob": 1}
        with django_capture_on_commit_callbacks(execute=True):
            finish(submit_model(race=race, racer=alice, model=mine, now=now + HOUR), LAPS, now)
        assert ranks(race) == {"alice": 1, "bob": None}
        other = a_racer("carol")
        refused(race=race, racer=other, model=a_copy(other, mine), now=now)
        with django_capture_on_commit_callbacks(execute=True):
            withdraw(entry=Entry.objects.get(racer=alice), now=now + HOUR)
        assert ranks(race) == {"bob": 1}, "who brought it has left"

    def test_a_house_sample_belongs_to_its_first_sender(self, alice, bob, now):
        race, sample = a_race(now), a_model(a_racer(is_house=True))
        a_copy(alice, sample)
        assert submit_model(race=race, racer=bob, model=a_copy(bob, sample), now=now)
        refused(race=race, racer=alice, model=TrainedModel.objects.get(owner=alice), now=now)

    def test_house_cars_and_racers_cars_do_not_exclude_each_other(self, alice, bob, now):
        race, house = a_race(now), a_racer(is_house=True)
        sample = a_model(house)
        for racer in (house, alice):
            assert submit_model(race=race, racer=racer, model=a_copy(racer, sample), now=now)
        refused(race=race, racer=bob, model=a_copy(bob, sample), now=now)
        late = a_racer(is_house=True)
        assert submit_model(race=race, racer=late, model=a_copy(late, sample), now=now)

    def test_the_demos_beginners_race_allows_shared_cars(self, db):
        from league.seasons.services.demo_season import COMMUNITY_RACES

        assert [race["name"] for race in COMMUNITY_RACES if race.get("shared_cars")] == ["First laps on the oval"]

    def test_stopping_a_car_or_leaving_frees_its_place(self, alice, bob, now):
        for leave in (
            lambda sent: stop_evaluation(evaluation=sent.evaluation, now=now),
            lambda sent: withdraw(entry=sent.entry, now=now),
        ):
            race, model = a_race(now), a_model(alice)
            leave(submit_model(race=race, racer=alice, model=model, now=now))
            copy = a_copy(bob, model)
            Submission.objects.filter(entry__racer=alice, evaluation__state="stopped").update(is_void=True)
            assert submit_model(race=race, racer=bob, model=copy, now=now)
            TrainedModel.objects.filter(pk=copy.pk).update(deleted_at=now)

    def test_the_database_allows_one_place_for_a_car(self, alice, bob, now):
        race = a_race(now)
        sent = drive(race, alice, LAPS, now)
        other = enter_race(race=race, racer=bob, now=now)
        with pytest.raises(IntegrityError), transaction.atomic():
            RaceCar.objects.create(race=race, car=sent.network_id, entry=other)
        with pytest.raises(IntegrityError), transaction.atomic():
            Submission.objects.filter(pk=sent.pk).update(car_of=sent.entry)


class TestEarlierEntries:
    def test_the_earlier_submission_counts_and_the_board_says_so(self, alice, bob, now):
        race = a_race(now)
        first = drive(race, alice, laps(9_500, 9_500, 9_500), now)
        as_before_the_rule(race, bob, a_copy(bob, first.evaluation.model), now + HOUR)
        assert ranks(race) == {"bob": 1, "alice": 2}
        assert settle_cars(race=race) == 1 and settle_cars(race=race) == 0
        assert ranks(race) == {"alice": 1, "bob": None}
        page = Client().get(race.get_absolute_url()).content.decode()
        assert "excluded: same car as alice, submitted first" in page
        rows = {
            row["racer"]: row["car_of"] for row in Client().get(f"/api/v1/races/{race.slug}/board/").json()["results"]
        }
        assert rows == {"alice": None, "bob": "alice"}

    def test_another_car_of_the_racer_counts_and_clears_the_mark(self, alice, bob, now):
        race = a_race(now)
        first = drive(race, alice, LAPS, now)
        as_before_the_rule(race, bob, a_copy(bob, first.evaluation.model), now + HOUR)
        settle_cars(race=race)
        assert Entry.objects.get(racer=bob).car_of.racer == alice
        drive(race, bob, laps(10_000, 10_000, 10_000), now + HOUR)
        assert ranks(race) == {"alice": 1, "bob": 2} and Entry.objects.get(racer=bob).car_of is None

    def test_a_late_result_counts_only_for_the_first_sender(self, alice, bob, now):
        race, model = a_race(now, shared_cars=True), a_model(alice)
        runs = [submit_model(race=race, racer=one, model=a_copy(one, model), now=now) for one in (alice, bob)]
        Race.objects.update(shared_cars=False)
        settle_cars(race=race)
        for run in reversed(runs):
            finish(run, LAPS, now)
        assert ranks(race) == {"alice": 1, "bob": None}

    def test_the_second_racer_holds_the_place_while_the_first_is_out(self, alice, bob, now, commits):
        carol = a_racer("carol")
        race = a_race(now, organiser=carol)
        first = drive(race, alice, LAPS, now)
        as_before_the_rule(race, bob, a_copy(bob, first.evaluation.model), now + HOUR)
        settle_cars(race=race)
        withdraw(entry=first.entry, now=now + HOUR)
        assert ranks(race) == {"bob": 1}
        enter_race(race=race, racer=alice, now=now + HOUR)
        assert ranks(race) == {"alice": 1, "bob": None}
        remove_entry(entry=Entry.objects.get(racer=alice), by=carol, now=now)
        assert ranks(race) == {"bob": 1}

    def test_races_with_shared_cars_are_unchanged(self, alice, bob, now):
        race = a_race(now, shared_cars=True)
        sent = drive(race, alice, LAPS, now)
        as_before_the_rule(race, bob, a_copy(bob, sent.evaluation.model), now)
        Race.objects.filter(pk=race.pk).update(shared_cars=True)
        assert settle_cars(race=race) == 0 and not RaceCar.objects.exists()


class TestWhatOrganisersSee:
    def test_organisers_see_who_was_first_and_who_was_refused(self, alice, bob, now):
        carol = a_racer("carol")
        race = a_race(now, organiser=carol)
        first = answering(a_model(alice), "a")
        finish(submit_model(race=race, racer=alice, model=first, now=now), LAPS, now)
        refused(race=race, racer=bob, model=answering(a_model(bob), "a"), now=now + HOUR)
        refused(race=race, racer=carol, model=a_copy(carol, first), now=now + HOUR)
        (car,) = shared_cars(race)
        assert [(one.racer.alias, one.how, one.same_file) for one in car.sharers] == [
            *(("alice", "first", True), ("bob", "refused", False), ("carol", "refused", True)),
        ]
        client = Client()
        client.force_login(carol, backend="django.contrib.auth.backends.ModelBackend")
        page = client.get(f"/races/{race.slug}/racers/").content.decode()
        assert "Same car" in page and "same outputs" in page and "refused" in page

    def test_nothing_is_shown_if_all_cars_differ(self, alice, bob, now):
        race = a_race(now)
        drive(race, alice, LAPS, now), drive(race, bob, LAPS, now)
        assert shared_cars(race) == []

    def test_a_second_attempt_adds_no_second_row(self, alice, bob, now):
        race = a_race(now)
        first = drive(race, alice, LAPS, now)
        copy = a_copy(bob, first.evaluation.model)
        for moment in (now, now + HOUR):
            refused(race=race, racer=bob, model=copy, now=moment)
        assert RefusedCar.objects.get().at == now + HOUR

    def test_an_attempt_by_a_run_of_ones_own_is_noted_too(self, alice, bob, now):
        race = a_race(now)
        copy = a_copy(bob, drive(race, alice, LAPS, now).evaluation.model)
        own = drive_own(owner=bob, model=copy, race=race, submit_if_better=True, now=now)
        running = start(own.evaluation, now)
        assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome(LAPS), now=now)
        own.refresh_from_db()
        assert own.submit_reason_code == "car_of_another" and RefusedCar.objects.get().racer == bob

    def test_racers_sharing_a_car_are_shown_too(self, alice, bob, now):
        race = a_race(now, shared_cars=True)
        first = drive(race, alice, LAPS, now)
        submit_model(race=race, racer=bob, model=a_copy(bob, first.evaluation.model), now=now)
        (car,) = shared_cars(race)
        assert [one.how for one in car.sharers] == ["first", "counts"]

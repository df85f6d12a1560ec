"""Rounds become official: once, in turn, with all that follows."""

from __future__ import annotations

import pytest
from django.core.exceptions import ValidationError

from core.database.clock import database_now
from core.events import Event
from league.models import ChampionshipPlace, FinalePlace, Membership, Round, RoundPoints, StageRules
from league.seasons.selectors import hall_of_fame, racer_season
from league.seasons.services.seasons import put_in_division, set_stage_rules
from league.standings.selectors.boards import field_of
from league.standings.selectors.months import months_of
from league.standings.selectors.outcomes import outcome_of, rules_of
from league.standings.selectors.standings import season_standings
from league.stewarding.official_results import close_due_rounds, close_round
from league.tasks import clock, close_rounds
from races.entries.services.entries import enter_race
from races.entries.services.submissions import submit_model
from races.models import Entry
from races.pages.services import cancel_race
from tests.factories import a_model, a_racer, finish, laps
from tests.league.seasons import HOUR, JANUARY, a_round, a_season, after, board, cut_of, racers, stand
from tests.races.test_concurrency import at_once
from tests.refusals import refused

pytestmark = pytest.mark.django_db


def pros(season) -> list[str]:
    return sorted(Membership.objects.filter(season=season, division="pro").values_list("racer__alias", flat=True))


def everything() -> list[list]:
    models = (Membership, FinalePlace, ChampionshipPlace, RoundPoints)
    return [list(model.objects.order_by("pk").values()) for model in models]


def test_the_best_of_the_open_race_are_promoted_when_official(season):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    before = outcome_of(january)
    assert [racer for _place, racer in before.promoted] == [ten[0].pk, ten[1].pk]
    assert not Membership.objects.exists(), "as it stands is not official"
    closed = close_round(round=january, now=after(january))
    assert closed.closed_at == after(january)
    assert pros(season) == sorted(one.alias for one in ten[:2])
    assert set(Membership.objects.values_list("place", "since", "promoted_in")) == {
        (1, january.race.closes_at, january.pk),
        (2, january.race.closes_at, january.pk),
    }
    assert outcome_of(closed) == before, "official results say the same when asked again"


def test_a_round_becomes_official_only_once(season):
    january = a_round(season, 1, "open-qualifier")
    board(january.race, racers(10))
    first = close_round(round=january, now=after(january))
    rows = everything()
    again = close_round(round=Round.objects.get(pk=january.pk), now=after(january, days=3))
    assert again.closed_at == first.closed_at and everything() == rows
    assert close_due_rounds(now=after(january, days=3)) == [] and close_rounds() == 0


@pytest.mark.django_db(transaction=True)
def test_six_concurrent_closings_close_a_round_once(season):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    closed = at_once([lambda: close_round(round=january, now=after(january))] * 6)
    assert closed == [january] * 6
    assert len({one.closed_at for one in closed}) == 1
    assert Membership.objects.count() == 2 and RoundPoints.objects.count() == 4


def test_nothing_is_official_before_the_race_closes(season):
    january = a_round(season, 1, "open-qualifier")
    refused("round_not_over", close_round, round=january, now=january.race.closes_at - HOUR)
    assert close_due_rounds(now=january.race.closes_at - HOUR) == []
    assert close_due_rounds(now=january.race.closes_at) == [january]


def test_closing_waits_for_a_car_sent_in_time(season):
    january, racer = a_round(season, 1, "open-qualifier"), a_racer()
    sent = january.race.closes_at - HOUR
    submission = submit_model(race=january.race, racer=racer, model=a_model(racer), now=sent)
    fault = refused("round_still_driving", close_round, round=january, now=after(january))
    assert fault.params == {"waiting": 1}
    finish(submission, laps(10_000, 10_000, 10_000), after(january))
    close_round(round=january, now=after(january))
    assert pros(season) == [racer.alias]


def test_rounds_become_official_in_order(season):
    january, february = a_round(season, 1, "open-qualifier"), a_round(season, 2, "open-qualifier")
    assert refused("round_out_of_order", close_round, round=february, now=after(february)).params == {
        "race": january.race.name
    }
    assert close_due_rounds(now=after(february)) == [january, february]


def test_a_cancelled_race_has_no_effect_and_delays_no_round(season):
    january, february = a_round(season, 1, "open-qualifier"), a_round(season, 2, "open-qualifier")
    ten = racers(10)
    board(january.race, ten)
    board(february.race, ten[::-1])
    cancel_race(race=january.race, reason="Rain", now=JANUARY + HOUR)
    january.refresh_from_db()
    refused("round_cancelled", close_round, round=january, now=after(january))
    assert close_due_rounds(now=after(february)) == [february]
    assert pros(season) == sorted(one.alias for one in ten[-2:])


def test_an_earlier_promotion_takes_no_place_away(season):
    january, february = a_round(season, 1, "open-qualifier"), a_round(season, 2, "open-qualifier")
    ten = racers(10)
    board(january.race, ten)
    board(february.race, [ten[0], *ten[2:]])
    close_due_rounds(now=after(february))
    assert sorted(Membership.objects.values_list("racer", flat=True)) == sorted([ten[0].pk, ten[1].pk, ten[2].pk])
    assert Membership.objects.get(racer=ten[0]).promoted_in == january


def test_a_division_set_by_an_admin_is_not_overwritten(season):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    put_in_division(season=season, racer=ten[0], division="open", now=JANUARY)
    close_round(round=january, now=after(january))
    assert Membership.objects.get(racer=ten[0]).division == "open"
    assert pros(season) == [ten[1].alias]


def test_house_cars_and_leavers_are_neither_promoted_nor_counted(season):
    january = a_round(season, 1, "open-qualifier")
    nine, house, gone = racers(9), a_racer(is_house=True), a_racer()
    board(january.race, [house], first_ms=1000, is_baseline=True)
    board(january.race, [gone], first_ms=2000, withdrawn_at=JANUARY)
    board(january.race, nine)
    close_round(round=january, now=after(january))
    assert pros(season) == sorted([nine[0].alias, nine[1].alias]), "9 of them: 1.8 is 2"
    assert RoundPoints.objects.get(rank=1).racer == nine[0]


def a_pro_month(season, number, order):
    for racer in order:
        put_in_division(season=season, racer=racer, division="pro", now=JANUARY)
    round_ = a_round(season, number, "pro-qualifier")
    board(round_.race, order)
    return round_


def test_only_the_best_of_the_pro_race_enter_its_finale(season):
    five = racers(5)
    january = a_pro_month(season, 1, five)
    finale = a_round(season, 1, "pro-finale")
    assert refused("race_not_in_field", enter_race, race=finale.race, racer=five[0], now=JANUARY + HOUR)
    close_round(round=january, now=after(january))
    assert list(FinalePlace.objects.values_list("place", "racer")) == [(n, five[n - 1].pk) for n in (1, 2, 3)]
    assert set(finale.race.entries.values_list("racer", flat=True)) == {one.pk for one in five[:3]}
    assert field_of(finale) == [one.pk for one in five[:3]]
    refused("race_not_in_field", enter_race, race=finale.race, racer=five[3], now=after(january))
    refused(
        "race_not_in_field",
        submit_model,
        race=finale.race,
        racer=five[4],
        model=a_model(five[4]),
        now=after(finale) - HOUR,
    )
    assert submit_model(race=finale.race, racer=five[2], model=a_model(five[2]), now=finale.race.opens_at)


def test_a_finale_scheduled_late_gets_its_field_immediately(season):
    january = a_pro_month(season, 1, racers(5))
    close_round(round=january, now=after(january))
    finale = a_round(season, 1, "pro-finale")
    assert finale.race.entries.count() == 3


def test_a_finale_cannot_open_before_its_qualifier_closes(season):
    january = a_round(season, 1, "pro-qualifier")
    times = {"opens_at": january.race.closes_at - HOUR, "closes_at": january.race.closes_at + HOUR}
    with pytest.raises(ValidationError) as caught:
        a_round(season, 1, "pro-finale", **times)
    assert caught.value.error_dict["race"][0].code == "finale_before_qualifier"
    assert not Round.objects.filter(stage="pro-finale").exists()


def test_finale_winners_qualify_and_leave_later_fields_to_others(season):
    six = racers(6)
    january, february = a_pro_month(season, 1, six), a_pro_month(season, 2, six)
    finale = a_round(season, 1, "pro-finale")
    close_due_rounds(now=after(january))
    board(finale.race, [six[2], six[0], six[1]])
    close_due_rounds(now=after(finale))
    qualified = ChampionshipPlace.objects.order_by("place").values_list("place", "racer")
    assert list(qualified) == [(1, six[2].pk), (2, six[0].pk)]
    close_due_rounds(now=after(february))
    field = FinalePlace.objects.filter(round=february).values_list("racer", flat=True)
    assert list(field) == [six[1].pk, six[3].pk, six[4].pk]


def test_only_qualified_racers_drive_the_championship(season):
    four = racers(4)
    january, finale = a_pro_month(season, 1, four), a_round(season, 1, "pro-finale")
    championship = a_round(season, 2, "championship")
    close_due_rounds(now=after(january))
    board(finale.race, four[:3])
    close_due_rounds(now=after(finale))
    assert set(championship.race.entries.values_list("racer", flat=True)) == {four[0].pk, four[1].pk}
    refused("race_not_in_field", enter_race, race=championship.race, racer=four[2], now=after(finale))
    board(championship.race, [four[1], four[0]])
    close_due_rounds(now=after(championship))
    hall = hall_of_fame()[0]
    assert hall.champion.racer == four[1] and [one.racer for one in hall.finales] == [four[0]]
    assert hall.divisions == {"pro": four[0]}


def test_an_eligibility_check_closes_no_round(season):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    february = a_round(season, 2, "pro-qualifier")
    refused("race_pro_only", enter_race, race=february.race, racer=ten[0], now=january.race.closes_at - HOUR)
    refused("race_pro_only", enter_race, race=february.race, racer=ten[0], now=january.race.closes_at)
    assert not Round.objects.filter(closed_at__isnull=False).exists(), "a check writes nothing"
    close_due_rounds(now=january.race.closes_at)
    assert enter_race(race=february.race, racer=ten[0], now=january.race.closes_at)
    refused("race_pro_only", enter_race, race=february.race, racer=ten[5], now=january.race.closes_at)


def test_everybody_may_enter_a_race_of_all_divisions(season):
    single, racer, pro = a_round(season, 1, "single"), a_racer(), a_racer()
    put_in_division(season=season, racer=pro, division="pro", now=JANUARY)
    for one in (racer, pro):
        assert enter_race(race=single.race, racer=one, now=JANUARY + HOUR)


def test_the_promotion_line_moves_until_results_are_official(season):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    assert cut_of(january).last_rank == 0
    board(january.race, ten)
    cut = cut_of(january)
    assert (cut.last_rank, cut.moved, cut.official) == (2, {ten[0].pk, ten[1].pk}, False)
    assert "20 %" in cut.sentence
    close_round(round=january, now=after(january))
    january.refresh_from_db()
    assert cut_of(january).official and cut_of(january).moved == cut.moved


def test_a_pro_races_line_is_below_the_last_finalist(season):
    six = racers(6)
    january, february = a_pro_month(season, 1, six), a_pro_month(season, 2, six)
    finale = a_round(season, 1, "pro-finale")
    assert (cut_of(january).last_rank, cut_of(finale).last_rank) == (3, 0)
    close_due_rounds(now=after(january))
    board(finale.race, six[:3])
    close_due_rounds(now=after(finale))
    assert cut_of(february).last_rank == 5, "the first two have qualified"
    assert cut_of(a_round(season, 3, "single")) is None


def test_standings_add_the_points_of_official_rounds(season):
    a, b, c = racers(3)
    a.country, a.team, b.country, b.team, c.country = "KR", "Red  Bulls", "KR", "red bulls", "DE"
    for one in (a, b, c):
        one.save()
    january, february = a_round(season, 1, "open-qualifier"), a_round(season, 2, "open-qualifier")
    board(january.race, [a, b, c])
    board(february.race, [c, b])
    close_due_rounds(now=after(january))
    assert [(one.holder, one.points) for one in season_standings(season, "open")] == [(a.pk, 10), (b.pk, 6), (c.pk, 3)]
    c.country = "FR"
    c.save()
    close_due_rounds(now=after(february))
    assert [(one.holder, one.points) for one in season_standings(season, "open")] == [
        (c.pk, 13),
        (b.pk, 12),
        (a.pk, 10),
    ]
    assert season_standings(season, "pro") == []
    by_country = [(one.holder, one.points) for one in season_standings(season, "open", "countries")]
    assert by_country == [("KR", 22), ("FR", 10), ("DE", 3)], "points stay with the country they were driven for"
    assert [(one.holder, one.points) for one in season_standings(season, "open", "teams")] == [("red bulls", 22)]


def test_a_racers_season_lists_every_round(season, django_assert_max_num_queries):
    ten = racers(10)
    january, pro = a_round(season, 1, "open-qualifier"), a_round(season, 2, "pro-qualifier")
    finale = a_round(season, 2, "pro-finale")
    board(january.race, ten)
    close_due_rounds(now=after(january))
    board(pro.race, ten[:2])
    close_due_rounds(now=after(pro))
    stand(finale.race, ten[1], 20_000)
    close_due_rounds(now=after(finale))
    with django_assert_max_num_queries(7):
        rows = racer_season(season, ten[1])
    told = [(row.round.stage, row.rank, row.points, row.promoted, row.in_finale, row.qualified) for row in rows]
    assert told == [
        ("open-qualifier", 2, 6, True, False, False),
        ("pro-qualifier", 2, 6, False, True, False),
        ("pro-finale", 1, 0, False, False, True),
    ]
    assert racer_season(season, a_racer()) == []


def test_a_month_holds_the_races_of_each_stage(season, django_assert_num_queries):
    for number, stage in ((1, "open-qualifier"), (1, "pro-qualifier"), (1, "pro-finale"), (2, "single")):
        a_round(season, number, stage)
    with django_assert_num_queries(1):
        first, second = months_of(season)
    assert (first.number, first.name, [one.stage for one in first]) == (
        1,
        "Month 1",
        ["open-qualifier", "pro-qualifier", "pro-finale"],
    )
    assert second.open is None and [one.stage for one in second] == ["single"]


def test_the_rules_of_a_season_follow_its_settings(season):
    sentences = rules_of(season)
    assert len(sentences) == 5
    assert (
        "20 %" in sentences[0]
        and "best 3" in sentences[1]
        and "best 2" in sentences[2]
        and "10, 6, 3, 1" in sentences[3]
    )


def test_races_take_the_rules_of_their_stage(season):
    set_stage_rules(season=season, stage="pro-finale", ranking_method="best", laps=15, minimum_laps=1)
    finale = a_round(season, 1, "pro-finale").race
    assert (finale.ranking_method, finale.laps, finale.minimum_laps) == ("best", 15, 1)
    assert a_round(season, 2, "pro-finale", laps=5).race.laps == 5
    with pytest.raises(ValidationError):
        set_stage_rules(season=season, stage="pro-finale", laps=0)
    with pytest.raises(TypeError):
        set_stage_rules(season=season, stage="pro-finale", name="x")
    assert StageRules.objects.count() == 1


@pytest.mark.parametrize(
    "settings, field, code",
    [
        ({"promotion_percent": 0}, "promotion_percent", "season_cut"),
        ({"promotion_percent": 100}, "promotion_percent", "season_cut"),
        ({"points": [10, 11]}, "points", "season_points_rise"),
        ({"points": []}, "points", "season_points_shape"),
        ({"points": [10, -1]}, "points", "season_points_shape"),
        ({"points": [1.5]}, "points", "season_points_shape"),
        ({"points": "10"}, "points", "season_points_shape"),
        ({"finale_size": 2, "championship_places": 3}, "championship_places", "season_more_places_than_cars"),
    ],
)
def test_invalid_season_numbers_are_refused_on_their_field(db, settings, field, code):
    with pytest.raises(ValidationError) as caught:
        a_season(**settings)
    assert code in [error.code for error in caught.value.error_dict[field]]


def test_races_of_one_stage_do_not_overlap(season):
    first = a_round(season, 1, "open-qualifier")
    with pytest.raises(ValidationError) as caught:
        a_round(
            season, 2, "open-qualifier", opens_at=first.race.closes_at - HOUR, closes_at=first.race.closes_at + HOUR
        )
    assert caught.value.error_dict["race"][0].code == "rounds_overlap"
    assert a_round(season, 2, "open-qualifier"), "one may begin when the other ends"
    assert a_round(season, 1, "pro-qualifier"), "another division races at the same time"


def test_a_race_of_another_division_cannot_take_a_stage(season):
    with pytest.raises(ValidationError) as caught:
        a_round(season, 1, "pro-finale", division="open")
    assert caught.value.error_dict["stage"][0].code == "round_of_another_division"


def test_closing_a_month_with_many_racers_needs_few_queries(season, django_assert_max_num_queries):
    january = a_round(season, 1, "open-qualifier")
    board(january.race, racers(60))
    with django_assert_max_num_queries(25):
        close_round(round=january, now=after(january))
    assert Membership.objects.count() == 12 and Entry.objects.count() == 60


def test_a_worker_whose_clock_is_ahead_closes_no_round_early(season, monkeypatch):
    now = database_now()
    race = a_round(season, 1, "open-qualifier").race
    race.opens_at, race.closes_at = now - 12 * HOUR, now + HOUR
    race.save(update_fields=["opens_at", "closes_at"])
    monkeypatch.setattr("django.utils.timezone.now", lambda: now + 40 * HOUR)
    clock()
    assert close_rounds() == 0
    assert not Event.objects.filter(kind="race.closed").exists()

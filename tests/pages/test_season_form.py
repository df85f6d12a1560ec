"""The form of a season: what races are by pattern and one by one, looked at before anything is made."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta

import pytest
from django.utils import timezone

from league.models import Season, Stage
from league.seasons.services.demo_season import OPEN_TRACKS, PRO_TRACKS, open_demo_season
from league.seasons.services.season_plan import Turning
from paddock.rules.race import LAYOUT
from races.models import Race
from races.models.sensors import OFFERABLE
from tests.clients import logged_in
from tests.factories import a_racer, a_track
from tests.pages.test_season_making import form_data, make

pytestmark = pytest.mark.django_db
NOW = datetime(2026, 11, 15, 12, tzinfo=UTC)
OF_A_RACE = (
    *("race_type", *LAYOUT, "seed", "direction", "sensors", "laps", "minimum_laps", "ranking_method"),
    *("off_track_penalty_ms", "collision_penalty_ms", "max_simulated_ms", "max_resets", "max_submissions"),
    *("opens_at", "closes_at"),
)


@pytest.fixture(autouse=True)
def _alone(wakes: list[dict], monkeypatch: pytest.MonkeyPatch) -> None:
    """No broker, and it is November 2026 for every view."""
    monkeypatch.setattr("django.utils.timezone.now", lambda: NOW)


@pytest.fixture
def client():
    return logged_in(a_racer("boss", is_staff=True, is_superuser=True))


def short(**changes: object) -> dict[str, object]:
    """The form for three months of 2027."""
    unused = {f"{kind}_{place}": "" for kind in ("open", "pro") for place in range(4, 13)}
    return form_data(NOW) | unused | changes


def look(client, data: dict[str, object]):
    return client.post("/seasons/new/", data)


def shown(answer) -> dict[str, Race]:
    """The races of a preview by their keys."""
    return {one.plan.key: one.race for _month, races in answer.context["rounds"] for one in races}


def open_round(client, data: dict[str, object], key: str):
    """The page of one race of a season that is planned."""
    return client.post("/seasons/new/", data | {"do": f"change:{key}"})


def keep(client, page, do: str = "keep", **changes: object):
    """Send the form of one race with ``changes``; what the page proposes for everything else."""
    form, sent = page.context["form"], {}
    for name in form.fields:
        value = form[name].value()
        if name == "boxes":
            continue
        sent[name] = "" if value in (None, False) else value
    for name in ("opens_at", "closes_at"):
        sent[name] = sent[name].strftime("%Y-%m-%dT%H:%M")
    sent |= {"season": page.context["season"], "round": page.context["round"].key, "do": do}
    return client.post("/seasons/new/", sent | changes)


def again(answer) -> dict[str, object]:
    """What a page's form would send as it stands."""
    form, sent = answer.context["form"], {}
    for name in form.fields:
        value = form[name].value()
        sent[name] = "" if value in (None, False) else value
    return sent


def fields_of(season: Season, names: tuple[str, ...] = OF_A_RACE) -> dict[tuple[int, str], dict]:
    rounds = season.rounds.select_related("race__track")
    return {
        (one.number, one.stage): {name: getattr(one.race, name) for name in names} | {"track": one.race.track.slug}
        for one in rounds
    }


@pytest.mark.slow
def test_the_form_can_make_the_season_of_a_fresh_installation(client):
    demo = open_demo_season(now=NOW)
    rules = {"ranking_method": "average", "laps": "3", "minimum_laps": "3", "max_submissions": ""}
    months = {
        name: value
        for place in range(1, 13)
        for name, value in (
            (f"open_{place}", OPEN_TRACKS[(place - 1) % 6]),
            (f"pro_{place}", PRO_TRACKS[(place - 1) % 6]),
        )
    }
    stages = {
        f"{stage}_{name}": value for stage in ("open", "pro", "finale", "championship") for name, value in rules.items()
    }
    stages |= {f"{stage}_off_track_penalty_ms": "5" for stage in ("pro", "finale", "championship")}
    stages |= {"open_off_track_penalty_ms": "3", "open_collision_penalty_ms": "5"}
    data = form_data(NOW, slug="mine", year="2026", first_month="11", turning="halves", **months, **stages)
    answer = make(client, data)
    assert answer.status_code == 302, answer.context["form"].errors
    mine, wanted = fields_of(Season.objects.get(slug="mine")), fields_of(demo)
    assert mine.keys() == wanted.keys() and len(mine) == 37
    for key in wanted:
        assert mine[key] == wanted[key], key


def test_pro_races_and_finales_follow_the_pattern(client):
    a_track()
    data = short(
        pro_turn_1="object_avoidance", pro_turn_2="bots", pro_turn_3="models", pro_random_boxes="2", pro_bots="3"
    )
    data |= {"open_turn_1": "time_trial", "open_turn_2": "object_avoidance", "open_sensors": ["LIDAR"]}
    races = shown(look(client, data))
    types = {key: (race.race_type, race.random_boxes, race.opponents, race.bots) for key, race in races.items()}
    for stage in ("pro", "finale"):
        assert types[f"1-{stage}"] == ("object_avoidance", 2, "", 0)
        assert types[f"2-{stage}"] == ("head_to_head", 0, "bots", 3)
        assert types[f"3-{stage}"] == ("head_to_head", 0, "models", 0)
    assert [races[f"{month}-open"].race_type for month in (1, 2, 3)] == ["time_trial", "object_avoidance", "time_trial"]
    assert races["1-open"].sensors == ["LIDAR"] and set(races["1-pro"].sensors) == set(OFFERABLE)
    assert races["championship"].duel_format == "bracket"
    assert not Season.objects.exists(), "it is only looked at"


@pytest.mark.parametrize(
    ("turning", "directions"),
    [
        ("ccw", "ccw ccw ccw ccw ccw"),
        ("cw", "cw cw cw cw cw"),
        ("alternating", "ccw cw ccw cw ccw"),
        ("halves", "ccw ccw ccw cw cw"),
    ],
)
def test_directions_follow_the_pattern(turning, directions):
    assert [Turning(turning).of(number, 5) for number in range(1, 6)] == directions.split()


def test_a_month_may_have_its_own_direction(client):
    a_track()
    races = shown(look(client, short(turning="alternating", direction_1="cw")))
    assert [races[f"{month}-{stage}"].direction for month in (1, 2, 3) for stage in ("open", "finale")] == (
        ["cw", "cw", "cw", "cw", "ccw", "ccw"]
    )


def test_changing_one_race_changes_its_finale(client):
    a_track()
    data = short()
    page = open_round(client, data, "2-pro")
    assert page.status_code == 200 and "February pro" in page.content.decode()
    boxes = {"boxes-1-percent": "25", "boxes-1-lane": "inner", "boxes-2-percent": "70", "boxes-2-lane": "outer"}
    answer = keep(
        client, page, race_type="object_avoidance", box_choice="fixed", laps="7", max_submissions="4", **boxes
    )
    assert answer.status_code == 200, answer.context["form"].errors
    races = shown(answer)
    places = [{"fraction": 0.25, "lane": "inner"}, {"fraction": 0.7, "lane": "outer"}]
    assert races["2-pro"].boxes == races["2-finale"].boxes == places
    assert (races["2-pro"].laps, races["2-finale"].laps, races["1-pro"].laps) == (7, 3, 5)
    assert answer.context["changed"] == {"2-pro"}
    answer = client.post("/seasons/new/", again(answer) | {"do": "make"})
    assert answer.status_code == 302
    made = Season.objects.get().rounds.get(number=2, stage=Stage.PRO).race
    assert (made.boxes, made.laps, made.max_submissions, made.bots) == (places, 7, 4, 0)


def test_an_edited_race_keeps_its_edits_when_the_pattern_changes(client):
    a_track()
    answer = keep(client, open_round(client, short(), "1-open"), max_submissions="3")
    answer = look(client, again(answer) | {"open_laps": "9", "open_turn_1": "bots"})
    race = shown(answer)["1-open"]
    assert (race.max_submissions, race.laps, race.race_type) == (3, 9, "head_to_head")
    page = open_round(client, again(answer), "1-open")
    assert page.context["form"]["max_submissions"].value() == 3, "its own page shows it as it is now"
    answer = keep(client, page, do="pattern")
    assert shown(answer)["1-open"].max_submissions is None and answer.context["changed"] == set()


def test_times_of_a_race_are_in_the_readers_time_zone(client):
    a_track()
    client.cookies["zone"] = "America/New_York"
    page = open_round(client, short(zone="Asia/Seoul"), "1-open")
    assert 'value="2026-12-31T10:00"' in page.content.decode()
    with timezone.override("America/New_York"):  # in which the form is read again here
        answer = keep(client, page, opens_at="2027-01-04T19:00")
    assert shown(answer)["1-open"].opens_at == datetime(2027, 1, 5, 0, tzinfo=UTC)
    assert shown(answer)["1-open"].closes_at == shown(answer)["2-open"].opens_at


def test_an_impossible_race_is_reported_and_nothing_is_made(client):
    a_track()
    data = short(pro_turn_1="bots", pro_turn_2="", pro_bots="6", pro_bot_speed_mps="9")
    answer = look(client, data)
    assert answer.status_code == 422 and "pro_bot_speed_mps" in answer.context["form"].errors
    page = open_round(client, short(), "1-finale")
    answer = keep(client, page, opens_at="2027-01-20T09:00")
    assert answer.status_code == 422
    told = {one.plan.key: one.problems for _month, races in answer.context["rounds"] for one in races if one.problems}
    assert list(told) == ["1-finale"] and "closes" in told["1-finale"][0]
    assert 'value="make"' not in answer.content.decode()
    again_ = client.post("/seasons/new/", again(answer) | {"do": "make"})
    assert again_.status_code == 422 and not Season.objects.exists()


def test_impossible_boxes_are_refused_on_the_races_own_page(client):
    a_track()
    page = open_round(client, short(), "1-pro")
    boxes = {"boxes-1-percent": "50", "boxes-1-lane": "inner", "boxes-2-percent": "50", "boxes-2-lane": "outer"}
    answer = keep(client, page, race_type="object_avoidance", box_choice="fixed", **boxes)
    assert answer.status_code == 422 and answer.templates[0].name == "league/seasons/round_form.html"
    answer = keep(client, page, laps="0")
    assert "laps" in answer.context["form"].errors


def test_a_season_is_made_only_after_a_preview(client):
    a_track()
    answer = client.post("/seasons/new/", short(do="make"))
    assert answer.status_code == 200 and shown(answer) and not Season.objects.exists()
    answer = client.post("/seasons/new/", again(answer) | {"open_laps": "4", "do": "make"})
    assert answer.status_code == 200 and "has changed since your preview" in answer.content.decode()
    assert not Season.objects.exists()
    assert client.post("/seasons/new/", again(answer) | {"do": "make"}).status_code == 302


@pytest.mark.parametrize(
    "changes",
    [
        *("{", "[]", "null", '{"1-open": 3}', '{"1-open": {"data": {"laps": 5}, "fields": ["laps"]}}'),
        '{"1-open": {"data": {"laps": ["x"]}, "fields": ["laps", "slug", "kind"]}}',
        "[" * 100_000,
    ],
)
def test_a_forged_plan_changes_nothing(client, changes):
    a_track()
    answer = look(client, short(changes=changes))
    assert answer.status_code == 200 and shown(answer)["1-open"].laps == 3


@pytest.mark.parametrize("season", ["", "{", "[1]", json.dumps({"name": "x"}), json.dumps({"name": [1]})])
def test_a_forged_page_of_a_race_is_refused(client, season):
    assert client.post("/seasons/new/", {"round": "1-open", "season": season, "do": "keep"}).status_code == 400


def test_a_race_missing_from_the_plan_leads_back_to_the_season(client):
    a_track()
    assert shown(open_round(client, short(), "17-open")), "the preview again"
    page = open_round(client, short(), "3-open")
    answer = client.post("/seasons/new/", {"round": "9-open", "season": page.context["season"], "do": "keep"})
    assert answer.status_code == 200 and answer.context["changed"] == set()


def test_a_season_across_new_year_has_its_months_in_order(client):
    a_track()
    data = form_data(NOW, year="2027", first_month="10", **{f"open_{place}": "" for place in range(7, 13)})
    answer = look(client, data)
    assert [month for month, _races in answer.context["rounds"]] == [
        *("October", "November", "December", "January", "February", "March", "Championship")
    ]
    races = shown(answer)
    assert races["12-open"].opens_at + timedelta(days=31) == races["13-open"].opens_at
    assert races["15-open"].opens_at.date().isoformat() == "2028-03-01"


def test_all_problems_of_the_numbers_are_reported_at_once(client) -> None:
    a_track()
    wrong = {"name": "", "points": "1, 2", "promotion_percent": "100", "finale_size": "2", "championship_places": "x"}
    answer = look(client, short(**wrong, slug="new", open_laps="2", open_minimum_laps="3", pro_laps="x"))
    assert answer.status_code == 422
    expected = {"name", "slug", "points", "promotion_percent", "championship_places", "open_minimum_laps", "pro_laps"}
    assert set(answer.context["form"].errors) == expected


def test_races_that_cannot_be_so_are_reported_beside_a_wrong_name(client) -> None:
    a_track()
    answer = look(
        client, short(name="", open_turn_1="object_avoidance", open_random_boxes="8", open_box_distance_m="9")
    )
    assert answer.status_code == 422
    errors = answer.context["form"].errors
    assert "name" in errors and errors.as_data()["__all__"], errors

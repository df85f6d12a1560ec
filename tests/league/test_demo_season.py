"""The season that a fresh installation opens, and the house cars in it."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from datetime import UTC, date, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import pytest
from django.utils import timezone

from accounts.models import Racer
from evaluation.models import Evaluation, TrainedModel
from league.house_cars import services as house_services
from league.house_cars.services import HOUSE_CARS_DIR, enter_house_cars, house_cars
from league.models import Round, Season, Stage
from league.seasons.services.demo_season import open_demo_season
from league.standings.selectors.boards import check_division
from paddock.errors import PlatformFault
from races.entries.selectors.lists import racing_now
from races.models import Entry, Race, RaceKind, RaceState
from races.models.sensors import OFFERABLE
from races.pages.services import create_community_race
from races.rules.layout import race_rules
from tests.factories import a_racer, a_track
from tests.kept import Kept
from tests.rows import model_row
from tracks.models import Track

pytestmark = pytest.mark.django_db


def everything() -> dict[str, list[dict]]:
    models = (Season, Round, Race, Racer, Track, Entry, TrainedModel, Evaluation)
    return {model.__name__: list(model.objects.order_by("pk").values()) for model in models}


@pytest.fixture(scope="session")
def kept_season(request: pytest.FixtureRequest, keep: Callable, now: datetime) -> Kept:
    return keep(request, lambda: open_demo_season(now=now))


@pytest.fixture
def season(kept_season: Kept, db: None) -> Season:
    """The season as a first start opens it."""
    return kept_season.copy()


@pytest.fixture
def stable(tmp_path: Path, monkeypatch) -> Path:
    """A folder with two house cars; reading them is the packages' business, so the upload is a stub here."""
    for name, title in (("steady", "Steady"), ("quick", "Quick")):
        (tmp_path / f"{name}.onnx").write_bytes(name.encode())
        noted = {"display_name": title, "description": f"{title} drives."}
        (tmp_path / f"{name}.json").write_text(json.dumps({"sensor": ["FRONT_FACING_CAMERA"], "house_car": noted}))

    class Raw:
        def __init__(self, files):
            self.source_sha256 = model_hash(files[0].stream.read())

    def upload(*, owner, files, description, look, now):
        class Uploaded:
            model = model_row(owner, name=files[0].name, onnx=files[0].stream.read(), at=now)

        TrainedModel.objects.filter(pk=Uploaded.model.pk).update(shell=look.shell, colour=look.colour)
        return Uploaded

    monkeypatch.setattr(house_services, "read_upload", Raw)
    monkeypatch.setattr(house_services, "upload_model", upload)
    return tmp_path


def model_hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def test_a_season_of_one_calendar_year_is_named_after_it():
    season = open_demo_season(now=datetime(2027, 1, 1, tzinfo=UTC))
    assert (season.slug, season.ends_on) == ("2027", date(2028, 1, 20))


def test_months_begin_at_midnight_in_the_sites_time_zone(settings):
    settings.TIME_ZONE = "Asia/Seoul"
    timezone.get_default_timezone.cache_clear()
    try:
        season = open_demo_season(now=datetime(2026, 10, 31, 16, 0, tzinfo=UTC))  # 1 November, 1:00 in Seoul
        assert season.starts_on == date(2026, 11, 1)
        first = season.rounds.get(number=1, race__division="open").race
        assert first.opens_at == datetime(2026, 10, 31, 15, 0, tzinfo=UTC)
    finally:
        timezone.get_default_timezone.cache_clear()


def test_a_season_made_by_the_operator_is_left_alone(now):
    mine = Season.objects.create(slug="mine", name="Mine", starts_on=date(2020, 1, 1), ends_on=date(2020, 12, 31))
    assert open_demo_season(now=now) == mine
    assert not Race.objects.exists()


def test_house_cars_do_not_enter_racers_own_races(now, stable):
    racer = a_racer()
    create_community_race(
        organiser=racer, now=now, name="Mine", track=a_track(), opens_at=now, closes_at=now + timedelta(days=1)
    )
    assert enter_house_cars(now=now, folder=stable) == 0


def test_a_racer_with_a_house_cars_alias_keeps_it(now, stable):
    a_racer("steady")
    open_demo_season(now=now)
    enter_house_cars(now=now, folder=stable)
    assert set(Racer.objects.filter(is_house=True).values_list("alias", flat=True)) == {
        "Paddock",
        "Quick",
        "house-steady",
    }


def test_the_committed_house_cars_can_be_read():
    cars = house_cars()
    assert {car.name for car in cars} == {path.stem for path in HOUSE_CARS_DIR.glob("*.onnx")}
    assert cars, "there is at least one"
    assert len({car.display_name for car in cars}) == len(cars)


def test_it_opens_twelve_months_from_this_month_on(season, now):
    assert (season.slug, season.name) == ("2026-27", "Season 2026-27")
    assert (season.starts_on, season.ends_on) == (date(2026, 11, 1), date(2027, 11, 20))
    for stage in (Stage.OPEN, Stage.PRO):
        rounds = list(season.rounds.filter(stage=stage).select_related("race").order_by("number"))
        assert [round_.number for round_ in rounds] == list(range(1, 13))
        assert rounds[0].race.opens_at == datetime(2026, 11, 1, tzinfo=UTC)
        for one, following in pairwise(rounds):
            assert one.race.closes_at == following.race.opens_at
        assert rounds[-1].race.closes_at == datetime(2027, 11, 1, tzinfo=UTC)
        assert len({round_.race.track_id for round_ in rounds}) == 6
        pairs = {(round_.race.track_id, round_.race.direction) for round_ in rounds}
        assert len(pairs) == 12, "the second half year drives the other way round"
        assert rounds[0].race.state_at(now) == RaceState.OPEN
        assert rounds[1].race.state_at(now) == RaceState.UPCOMING


def test_each_month_has_a_finale_and_the_season_a_championship(season):
    finales = list(season.rounds.filter(stage=Stage.FINALE).select_related("race").order_by("number"))
    pros = list(season.rounds.filter(stage=Stage.PRO).select_related("race").order_by("number"))
    assert [finale.name for finale in finales] == [pro.name for pro in pros] and finales[0].name == "November"
    for finale, pro in zip(finales, pros, strict=True):
        assert finale.race.opens_at > pro.race.closes_at
        assert (finale.race.track_id, finale.race.direction) == (pro.race.track_id, pro.race.direction)
    last = season.rounds.get(stage=Stage.CHAMPIONSHIP).race
    assert last.opens_at > finales[-1].race.closes_at and last.closes_at.date() <= season.ends_on


def test_the_season_has_races_of_every_type(season):

    def races(stage: str) -> list[Race]:
        return [one.race for one in season.rounds.filter(stage=stage).select_related("race").order_by("number")]

    assert {race.race_type for race in races(Stage.OPEN)} == {"time_trial"}
    pros, finales = races(Stage.PRO), races(Stage.FINALE)
    assert [race.race_type for race in pros[:4]] == ["object_avoidance", "head_to_head"] * 2
    assert all(race.opponents == "bots" for race in pros[1::2])
    for pro, finale in zip(pros, finales, strict=True):
        assert race_rules(finale) == race_rules(pro), "a finale is driven as its qualifier was"
        assert set(pro.sensors) == set(finale.sensors) == set(OFFERABLE)
    assert len({race_rules(pro).seed for pro in pros}) == 12, "every month has its own layout"
    (last,) = races(Stage.CHAMPIONSHIP)
    assert (last.opponents, last.duel_format) == ("models", "bracket")


def test_house_cars_enter_finales_too(season, stable):
    finale = season.rounds.get(number=1, stage=Stage.FINALE).race
    enter_house_cars(now=finale.opens_at, folder=stable)
    assert {entry.racer.alias for entry in finale.entries.filter(is_baseline=True)} == {"Steady", "Quick"}


def test_community_races_are_open_and_cover_all_ranking_methods(season, now):
    races = Race.objects.filter(kind=RaceKind.COMMUNITY)
    assert {race.ranking_method for race in races} == {"average", "best", "total"}
    assert all(race.state_at(now) == RaceState.OPEN and race.organiser.is_house for race in races)
    types = {(race.race_type, race.opponents) for race in races}
    assert types == {
        ("time_trial", ""),
        ("object_avoidance", ""),
        ("head_to_head", "bots"),
        ("head_to_head", "models"),
    }
    organiser = Racer.objects.get(alias="Paddock")
    assert organiser.is_house and not organiser.has_usable_password()


def test_opening_the_season_twice_changes_nothing(season, now):
    before = everything()
    open_demo_season(now=now + timedelta(days=100))
    assert everything() == before


def test_house_cars_enter_every_open_race_as_queued_baselines(season, now, stable):
    submitted = enter_house_cars(now=now, folder=stable)
    races = set(racing_now(now))
    assert len(races) == 8 and {race.division for race in races} == {"open", "pro", ""}
    assert submitted == 16
    entries = Entry.objects.select_related("race", "racer")
    assert {(entry.race, entry.racer.alias) for entry in entries} == {
        (race, alias) for race in races for alias in ("Steady", "Quick")
    }
    assert all(entry.is_baseline and not entry.classified for entry in entries), "nothing has driven yet"
    assert Evaluation.objects.filter(state="queued", priority__lt=0).count() == 16


def test_house_cars_are_sent_again_only_to_newly_opened_races(season, now, stable):
    enter_house_cars(now=now, folder=stable)
    before = everything()
    assert enter_house_cars(now=now, folder=stable) == 0
    assert everything() == before
    december = now + timedelta(days=30)
    assert enter_house_cars(now=december, folder=stable) == 4
    assert TrainedModel.objects.count() == 2


def test_a_deactivated_house_racer_is_not_sent(season, now, stable):
    enter_house_cars(now=now, folder=stable)
    Racer.objects.filter(alias="Quick").update(is_active=False)
    assert enter_house_cars(now=now + timedelta(days=30), folder=stable) == 2


def test_the_season_opens_even_without_house_cars(season, now, tmp_path, caplog):
    with caplog.at_level("INFO"):
        assert enter_house_cars(now=now, folder=tmp_path) == 0
        assert enter_house_cars(now=now, folder=tmp_path / "none") == 0
    assert "no house cars" in caplog.text
    assert not Entry.objects.exists()


def test_a_broken_house_car_is_logged_and_the_others_race(season, now, stable, monkeypatch, caplog):
    (stable / "broken.onnx").write_bytes(b"broken")
    (stable / "broken.json").write_text("{")
    shutil.copy(stable / "steady.onnx", stable / "lonely.onnx")
    assert [car.name for car in house_cars(stable)] == ["quick", "steady"]
    real = house_services.upload_model

    def refuse_quick(*, owner, **kwargs):
        if owner.alias == "Quick":
            raise PlatformFault("conversion_failed")
        return real(owner=owner, **kwargs)

    monkeypatch.setattr(house_services, "upload_model", refuse_quick)
    assert enter_house_cars(now=now, folder=stable) == 8
    assert "Quick stays at home" in caplog.text or "quick stays at home" in caplog.text
    assert "broken" in caplog.text and "lonely" in caplog.text


def test_nobody_may_enter_the_first_pro_race_yet(season, now, alice):
    pro = Race.objects.get(slug="2026-11-pro")
    with pytest.raises(Exception, match="pro division"):
        check_division(pro, alice, now)


def test_two_workers_that_create_a_house_racer_at_once_get_the_same_one(monkeypatch):
    """As where all workers of a new site start together."""
    given = {"name": "brisk", "display_name": "Brisk", "now": timezone.now()}
    free_alias, other = house_services._free_alias, []

    def free_meanwhile(*wanted):
        alias = free_alias(*wanted)
        monkeypatch.setattr(house_services, "_free_alias", free_alias)
        other.append(house_services.house_racer(**given))
        return alias

    monkeypatch.setattr(house_services, "_free_alias", free_meanwhile)
    assert house_services.house_racer(**given) == other[0]

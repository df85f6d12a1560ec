"""Every name of a catalogue track names it everywhere, and an unknown name is answered with the closest ones."""

from __future__ import annotations

import csv
from datetime import datetime
from pathlib import Path

import gymnasium
import pytest
from django.core.management import call_command
from django.utils import timezone

import paddock.simulator.envs  # noqa: F401  registers the environments
from league.history.columns import RACE_COLUMNS
from league.history.season_import import import_folder
from paddock.cli.driving import track_here
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.catalogue.names import direction_in, find, holding, key, nearest
from paddock.simulator.envs import load_track
from tests.factories import a_racer
from tests.shared import SHARED, needs_shared
from tracks.management.track_lookup import find_track
from tracks.models import Direction, Track
from tracks.services import free_slug, load_catalogue

NAMES = [
    ("penbay_open", "po-chun-speedway"),
    ("hamption_pro", "kuei-super-raceway"),
    ("arctic_pro", "hot-rod-super-speedway"),
    ("caecer_gp", "vivalas-speedway"),
    ("reinvent_base", "reinvent-2018"),
    ("re:Invent 2018", "reinvent-2018"),
    ("reinvent_wood", "reinvent-2018"),
    ("reInvent2019_track", "smile-speedway"),
    ("A to Z Speedway", "a-to-z-speedway"),
    ("Monaco_building", "european-seaside-circuit"),
    ("VEGAS_TRACK", "aws-summit-raceway"),
    ("po chun speedway", "po-chun-speedway"),
]
SENT = {"name": "Evening", "opens_at": "2027-01-01T00:00:00Z", "closes_at": "2027-01-02T00:00:00Z"}


@pytest.mark.parametrize(("name", "slug"), NAMES)
def test_names_of_the_old_console_and_of_files(name, slug):
    found = find(name)
    assert found is not None
    assert found.track.slug == slug
    assert track_here(name) is load_track(name) is find_track(name).geometry is by_slug(slug).geometry()
    assert slug in [track.slug for track in holding(name)]


def test_each_name_belongs_to_one_track():
    keys = [
        (key(name), track.slug) for track in CATALOGUE for name in {key(name): name for name in track.names}.values()
    ]
    assert len({one for one, _slug in keys}) == len(keys)
    assert all(find(name).track is track for track in CATALOGUE for name in track.names)


@needs_shared
def test_each_file_of_the_community_has_a_track():
    unknown = [file.stem for file in (SHARED / "tracks").glob("*.npy") if find(file.stem) is None]
    assert unknown == []


def test_the_name_of_a_variant_says_the_direction():
    assert find("reInvent2019_wide_cw").track.slug == "a-to-z-speedway"
    assert [direction_in(name) for name in ("penbay_open_cw", "penbay_open_ccw", "penbay_open", "nowhere_cw")] == [
        "cw",
        "ccw",
        None,
        None,
    ]


@pytest.mark.parametrize(
    ("name", "close"),
    [
        ("penbay_opn", "penbay_open (po-chun-speedway)"),
        ("Po-Chun Speeway", "po-chun-speedway"),
        ("hampton_pro", "hamption_pro (kuei-super-raceway)"),
        ("ovla", "oval"),
    ],
)
def test_the_closest_names_come_first(name, close):
    assert find(name) is None
    assert nearest(name)[0] == close
    with pytest.raises(ValueError, match=close.split()[0]):
        load_track(name)
    with pytest.raises(UserFault) as caught:
        track_here(name)
    assert caught.value.code == "track_unknown"
    assert caught.value.params["nearest"].startswith(close)


def test_the_environment_takes_every_name():
    for name, direction in (("reinvent_base", "ccw"), ("penbay_open_cw", "cw")):
        env = gymnasium.make("Paddock/TimeTrial-v1", track=name)
        assert env.unwrapped.setting.rules.direction == direction
        assert env.unwrapped.setting.ground.track.name == find(name).track.name
        env.close()


@pytest.mark.django_db
def test_the_api_takes_every_name_and_names_the_closest(client):
    load_catalogue()
    assert client.get("/api/v1/tracks/penbay_open/").json()["slug"] == "po-chun-speedway"
    missing = client.get("/api/v1/tracks/penbay_opn/")
    assert missing.status_code == 404
    assert "penbay_open (po-chun-speedway)" in missing.content.decode()
    found = client.get("/api/v1/tracks/", {"search": "penbay open"}).json()["results"]
    assert [track["slug"] for track in found] == ["po-chun-speedway"]
    client.force_login(a_racer("ann"))
    made = client.post("/api/v1/races/", {**SENT, "track": "penbay_open"}, content_type="application/json")
    assert made.status_code == 201, made.content
    assert made.json()["track"]["slug"] == "po-chun-speedway"
    for name, said in (("penbay_opn", "penbay_open (po-chun-speedway)"), ("penbay_open_cw", "direction cw")):
        refused = client.post("/api/v1/races/", {**SENT, "track": name}, content_type="application/json")
        assert refused.status_code in (400, 422)
        assert said in refused.content.decode()


@pytest.mark.django_db
def test_pages_lead_from_every_name_to_the_track(client):
    load_catalogue()
    assert client.get("/tracks/penbay_open/").headers["Location"] == "/tracks/po-chun-speedway/"
    missing = client.get("/tracks/penbay_opn/")
    assert missing.status_code == 404
    assert 'href="/tracks/po-chun-speedway/">penbay_open (po-chun-speedway)' in missing.content.decode()
    assert "po-chun-speedway" in client.get("/tracks/", {"q": "penbay opn"}).content.decode()
    assert client.get("/tracks/", {"q": "Penbay Open"}).context["page"].object_list[0].slug == "po-chun-speedway"


@pytest.mark.django_db
def test_no_other_track_takes_a_name_of_the_catalogue():
    assert free_slug("Penbay open") != "penbay-open"


def a_season(folder: Path, *tracks: str) -> Path:
    """A folder with one race on each track."""
    results = (
        "Alias,SubmissionTime,LapCount,AvgLapTime,BestLapTime,TotalLapTime,AvgResets,CollisionCount,OffTrackCount,"
        "ResetCount,SubmissionCount,Rank,LeaderboardSubmissionStatusType,RankingScore,UserId"
    )
    with (folder / "races.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, RACE_COLUMNS, restval="")
        writer.writeheader()
        for number, track in enumerate(tracks, start=1):
            opens, closes = f"2021-0{number}-01T00:00:00+00:00", f"2021-0{number}-20T00:00:00+00:00"
            writer.writerow(
                {"file": f"{number}.csv", "season": "2021", "name": f"Race {number}", "stage": "single"}
                | {"race_type": "time_trial", "timing_method": "total_time", "opens": opens, "closes": closes}
                | {"minimum_laps": "1", "maximum_laps": "1", "track": track}
            )
            moment = int(datetime.fromisoformat(opens).timestamp() * 1000) + 1000
            row = f"ann,{moment},1,9000,9000,9000,0,0,0,0,1,1,SUCCESS,9000,u1"
            (folder / f"{number}.csv").write_text(f"{results}\n{row}\n")
    return folder


@pytest.mark.django_db
def test_imported_races_have_the_map_of_their_track(tmp_path):
    (season,) = import_folder(folder=a_season(tmp_path, "penbay_open", "Spain_track", "nowhere"), now=timezone.now())
    races = [round_.race for round_ in season.rounds.select_related("race__track").order_by("number")]
    assert [(race.track.slug, race.track.has_shape) for race in races] == [
        ("po-chun-speedway", True),
        ("circuit-de-barcelona-catalunya", True),
        ("nowhere", False),
    ]
    assert [race.direction for race in races] == ["ccw", "cw", "ccw"]


@pytest.mark.django_db
def test_a_season_that_was_imported_without_maps_gets_them(tmp_path):
    (season,) = import_folder(folder=a_season(tmp_path, "nowhere"), now=timezone.now())
    Track.objects.filter(slug="nowhere").update(name="penbay_open", slug="penbay-open")
    load_catalogue()
    assert season.rounds.get().race.track.slug == "po-chun-speedway"
    assert not Track.objects.filter(length_m=None).exists()
    assert client_map(season.rounds.get().race)


def client_map(race) -> bool:
    """Whether the race's track can be drawn."""
    return race.track.geometry.length > 0 and race.direction in Direction.values


@pytest.mark.django_db
def test_a_command_says_the_closest_name(capsys):
    with pytest.raises(Exception, match=r"penbay_open \(po-chun-speedway\)"):
        call_command("evaluate", "car.zip", "--track", "penbay_opn")

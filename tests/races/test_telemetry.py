"""Telemetry of runs: what the document has, who may read it, and what is refused."""

from __future__ import annotations

import csv
import gzip
import io
import json
from collections.abc import Callable
from html import unescape

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import override

from evaluation.models import Evaluation, Result
from paddock.analysis.losses import Loss, Mistake, Stretch
from paddock.analysis.turns import turns_of
from paddock.simulator.engine import ENGINE_ID
from races.entries.services.entries import accept_invitation
from races.models import Visibility
from races.telemetry.document import REASONS, loss_sentence
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer
from tests.kept import Kept
from tests.paddock.analysis.mistakes import drive
from tracks.models import ReferenceLap

pytestmark = pytest.mark.django_db


@pytest.fixture(scope="session")
def kept_telemetry(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, lambda: _runs(timezone.now()))


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def runs(kept_telemetry: Kept, db: None):
    return kept_telemetry.copy()


def _runs(now):
    alice, bob = a_racer("alice"), a_racer("bob")
    public = a_race(now, slug="public", organiser=alice)
    secret = a_race(now, slug="secret", organiser=alice, visibility=Visibility.INVITATION)
    accept_invitation(token=secret.invitation, racer=bob, now=now)
    return {
        "alice": a_driven_run(public, alice, now, lap_ms=12_000),
        "bob": a_driven_run(public, bob, now, lap_ms=10_000),
        "secret": a_driven_run(secret, bob, now, lap_ms=11_000),
        "reverse": a_driven_run(a_race(now, slug="reverse", direction="cw"), bob, now),
    }


def address(run: Evaluation, kind: str = "json") -> str:
    return f"/evaluations/{run.public_id}/telemetry.{kind}"


def read(client, run, **query):
    answer = client.get(address(run), query)
    assert answer.status_code == 200, answer.content
    return answer.json()


def test_two_laps_are_given_on_one_grid(runs, client):
    found = read(client, runs["alice"], **{"with": f"{runs['bob'].public_id}:1"})
    track = runs["alice"].track.geometry
    one, other = found["runs"]
    assert (found["direction"], found["length_m"]) == ("ccw", round(track.length, 3))
    assert found["metres"][0] == 0 and found["metres"][-1] == pytest.approx(track.length, abs=0.01)
    assert (one["run"], one["lap"], one["time_ms"]) == (runs["alice"].public_id, 2, 11_999)  # its best lap
    assert (other["run"], other["lap"], other["time_ms"]) == (runs["bob"].public_id, 1, 10_000)
    channels = ("ms", "delta_ms", "speed", "driven_speed", "steer", "driven_steer", "offset", "curvature")
    assert {len(run[name]) for run in (one, other) for name in channels} == {len(found["metres"])}
    assert set(one["delta_ms"]) == {0}
    assert other["delta_ms"][-1] == 10_000 - 11_999
    assert one["reward"] is None
    assert max(map(abs, one["offset"])) < 0.02  # on the centre line
    speed = one["driven_speed"][len(found["metres"]) // 2]
    assert speed == pytest.approx(track.length / 12, rel=0.15)  # the rear axle drives a shorter way through a turn
    assert [turn["number"] for turn in found["turns"]] == [turn.number for turn in turns_of(track, "ccw")]


def test_mini_sectors_have_the_colours_of_racing(runs, client):
    alone = read(client, runs["alice"])
    assert len(alone["sectors"]) == 20
    assert sum(sector["times"][0] for sector in alone["sectors"]) == pytest.approx(11_999, abs=20)
    assert {sector["colours"][0] for sector in alone["sectors"]} <= {"green", "yellow"}
    both = read(client, runs["alice"], **{"with": runs["bob"].public_id})
    assert {sector["colours"][1] for sector in both["sectors"]} <= {"purple", "green"}
    assert "purple" not in {sector["colours"][0] for sector in both["sectors"]}


def test_a_run_has_its_theoretical_best_and_its_consistency(runs, client):
    (run,) = read(client, runs["alice"])["runs"]
    assert run["best_ms"] <= 11_999
    assert (run["laps"], run["mean_ms"], run["deviation_ms"]) == (3, 12_000, 1)
    assert run["off_road"] == []


def test_losses_are_measured_against_the_second_run(runs, client):
    found = read(client, runs["alice"], lap=1, **{"with": runs["bob"].public_id})
    assert found["against"] == {"run": runs["bob"].public_id, "lap": 2}
    assert [loss["turn"] for loss in found["losses"]] == [1, 2]
    for loss in found["losses"]:
        assert loss["ms"] >= 60 and loss["sentence"].startswith(f"{loss['ms'] / 1000:.2f} s lost")
        assert {reason["mistake"] for reason in loss["reasons"]} <= {mistake.value for mistake in Mistake}


def test_a_run_alone_is_measured_against_its_own_best_lap(runs, client):
    run = runs["alice"]
    assert read(client, run, lap=1)["against"] == {"run": run.public_id, "lap": 2}
    assert read(client, run, lap=2)["against"] is None
    assert read(client, run, lap=1)["losses"] == []  # of a lap that is 1 ms slower


@pytest.fixture
def reference(runs):
    """The reference lap of the oval: here a car at 2 m/s on the centre line."""
    run = drive("oval")
    return ReferenceLap.objects.create(
        track=runs["alice"].track,
        direction="ccw",
        engine=ENGINE_ID,
        state="finished",
        ended_at=timezone.now(),
        time_ms=min(lap.time_ms for lap in run.laps),
        laps=[lap.to_dict() for lap in run.laps],
        trace=gzip.compress(run.trace.to_csv()),
        trace_sha256="a" * 64,
    )


def test_a_lap_is_measured_against_the_reference_lap(runs, reference, client):
    found = read(client, runs["alice"], **{"with": "reference"})
    assert [run["run"] for run in found["runs"]] == [runs["alice"].public_id, "reference"]
    assert found["runs"][1]["time_ms"] == reference.time_ms
    assert found["against"]["run"] == "reference" and found["losses"]
    page = client.get(reverse("replay", args=[runs["alice"].public_id]), {"analysis": "part"}).content.decode()
    assert all(loss["sentence"] in page for loss in found["losses"])
    assert "with=reference" in page and page.count('class="sector-time ') == 40


def test_a_reference_lap_of_another_engine_or_direction_is_none(runs, reference, client):
    ReferenceLap.objects.update(engine="another")
    assert client.get(address(runs["alice"]), {"with": "reference"}).status_code == 404
    ReferenceLap.objects.update(engine=ENGINE_ID, direction="cw")
    assert client.get(address(runs["alice"]), {"with": "reference"}).status_code == 404


def test_the_document_is_made_once_for_all_readers(runs, client):
    first = client.get(address(runs["alice"]))
    again = Client().get(address(runs["alice"]), headers={"If-None-Match": first["ETag"]})
    assert again.status_code == 304
    other = Client().get(address(runs["alice"]), {"lap": 1}, headers={"If-None-Match": first["ETag"]})
    assert other.status_code == 200
    korean = Client().get(address(runs["alice"]), headers={"If-None-Match": first["ETag"], "Accept-Language": "ko"})
    assert korean.status_code == 200


def test_the_csv_has_what_is_shown(runs, client):
    query = {"lap": 1, "with": runs["bob"].public_id, "from": "2", "to": "3.05"}
    answer = client.get(address(runs["alice"], "csv"), query)
    assert answer["Content-Type"].startswith("text/csv") and "attachment" in answer["Content-Disposition"]
    rows = list(csv.DictReader(io.StringIO(answer.content.decode())))
    assert {(row["run"], row["lap"]) for row in rows} == {(runs["alice"].public_id, "1"), (runs["bob"].public_id, "2")}
    assert all(2 <= float(row["metres"]) <= 3.05 for row in rows)
    document = read(client, runs["alice"], lap=1, **{"with": runs["bob"].public_id})
    at = document["metres"].index(float(rows[0]["metres"]))
    for name in ("ms", "delta_ms", "speed", "driven_speed", "steer", "driven_steer", "offset", "curvature"):
        assert float(rows[0][name]) == document["runs"][0][name][at]
    assert rows[0]["reward"] == ""


@pytest.mark.parametrize("bounds", [{"from": "x"}, {"from": "nan", "to": "inf"}])
def test_bounds_that_are_no_numbers_are_the_whole_lap(runs, client, bounds):
    whole = client.get(address(runs["alice"], "csv")).content
    assert client.get(address(runs["alice"], "csv"), bounds).content == whole


def test_the_api_has_the_same_document(runs, client):
    query = {"lap": 1, "with": runs["bob"].public_id}
    answer = client.get(f"/api/v1/evaluations/{runs['alice'].public_id}/telemetry/", query)
    assert answer.json() == read(client, runs["alice"], **query)


def test_a_run_of_others_that_is_private_is_not_shown(runs, client):
    secret = runs["secret"]
    assert client.get(address(secret)).status_code == client.get(address(secret, "csv")).status_code == 404
    refused = client.get(address(runs["alice"]), {"with": secret.public_id})
    assert (refused.status_code, refused.json()["code"]) == (404, "compare_unknown")
    assert refused.json() == client.get(address(runs["alice"]), {"with": "nosuchrun"}).json()
    client.force_login(secret.owner)
    assert len(read(client, runs["alice"], **{"with": secret.public_id})["runs"]) == 2


def test_a_sealed_run_is_not_shown_to_anybody(runs, client):
    Evaluation.with_sealed.filter(pk=runs["bob"].pk).update(sealed=True)
    client.force_login(a_racer("stella", is_staff=True))
    assert client.get(address(runs["bob"])).status_code == 404
    assert client.get(address(runs["alice"]), {"with": runs["bob"].public_id}).status_code == 404


@pytest.mark.parametrize(
    ("query", "status", "code"),
    [
        ({"lap": "4"}, 400, "compare_lap"),
        ({"lap": "x"}, 400, "compare_lap"),
        ({"with": "reverse"}, 400, "compare_elsewhere"),
        ({"with": "alice"}, 400, "compare_itself"),
    ],
)
def test_what_cannot_be_compared_is_refused_with_its_reason(runs, client, query, status, code):
    client.force_login(runs["bob"].owner)
    query = {name: runs[value].public_id if value in runs else value for name, value in query.items()}
    answer = client.get(address(runs["alice"]), query)
    assert (answer.status_code, answer.json()["code"]) == (status, code)
    assert client.get(address(runs["alice"], "csv"), query).status_code == status
    api = client.get(f"/api/v1/evaluations/{runs['alice'].public_id}/telemetry/", query)
    assert (api.status_code, api.json()["code"]) == (status, code)


def test_a_trace_that_is_gone_is_the_platforms_fault(runs, client):
    Result.objects.filter(evaluation=runs["alice"]).update(trace="traces/gone.csv.gz")
    assert client.get(address(runs["alice"])).status_code == 503
    page = client.get(reverse("replay", args=[runs["alice"].public_id]), {"analysis": "1"})
    assert page.status_code == 200 and "data-telemetry" not in page.content.decode()


def test_the_page_of_the_viewer_has_everything_without_a_script(runs, client):
    query = {"lap": 1, "with": runs["bob"].public_id}
    address = reverse("replay", args=[runs["alice"].public_id])
    first = client.get(address, {**query, "t": "3", "camera": "top"}).content.decode()
    asked = unescape(first.partition('data-analysis="')[2].partition('"')[0])
    linked = unescape(first.partition('<a href="' + address)[2].partition('"')[0])
    assert "data-telemetry" not in first and linked.endswith("&analysis=1#analysis")
    page = client.get(address + linked.removesuffix("#analysis")).content.decode()
    part = client.get(asked).content.decode()
    assert "<html" in page and "<html" not in part and part.strip() in page
    document = read(client, runs["alice"], **query)
    for loss in document["losses"]:
        assert loss["sentence"] in page
        assert f"t={loss['t_ms'] / 1000:.2f}" in page
    assert page.count('class="sector-time ') == 40
    setup = json.loads(unescape(page.partition('data-telemetry="')[2].partition('"')[0]))
    assert client.get(setup["url"]).json() == document


def test_every_mistake_has_a_sentence_in_both_languages(runs):
    turn = turns_of(runs["alice"].track.geometry, "ccw")[0]
    assert set(REASONS) == set(Mistake)
    for mistake in Mistake:
        loss = Loss(Stretch(1.0, 2.0, turn, 1), 820, [(mistake, 0.34)], 0)
        english = loss_sentence(loss)
        assert english.startswith("0.82 s lost in turn 1: ")
        with override("ko"):
            assert loss_sentence(loss) != english
    straight = Loss(Stretch(1.0, 2.0, None, 3), 100, [(Mistake.SLOWER, 0.344)], 0)
    assert loss_sentence(straight) == "0.10 s lost on the straight after turn 3: drove 0.34 m/s slower"

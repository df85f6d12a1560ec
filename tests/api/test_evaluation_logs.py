"""The zip of a finished evaluation: the community's reader finds everything in it, where it lies."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from django.utils import timezone

from evaluation.garage.services import share_model
from evaluation.models import Result
from evaluation.running.queue.jobs import finish_evaluation
from paddock.rules.race import RaceRules
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceResult, RaceSettings, run_race
from paddock.simulator.results import metrics_json
from races.entries.services.submissions import submit_model
from tests.community import community
from tests.evaluation.stubs import car_outcome, outcome_of
from tests.factories import a_model, a_race, drive, laps, start
from tests.paddock.simulator.tracks_for_tests import stadium

pytestmark = pytest.mark.django_db


@pytest.fixture(scope="module")
def driven() -> RaceResult:
    """Two laps that were really driven."""
    track = stadium()
    pilot = CentreLinePilot(track, speed=2.0)
    return run_race(RaceSettings(track, RaceRules(laps=2), [Entrant(pilot.action_space, pilot.sensors, pilot)]))


@pytest.fixture
def now():
    return timezone.now()


def finished(racer, now, driven: RaceResult, **more):
    """An evaluation of the racer's that ended with this run."""
    evaluation = submit_model(race=a_race(now), racer=racer, model=a_model(racer), now=now).evaluation
    running = start(evaluation, now)
    outcome = replace(outcome_of(**more), trace_csv=driven.trace.to_csv(), metrics=metrics_json(driven))
    assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome, now=now)
    evaluation.refresh_from_db()
    return evaluation


def unpacked(response, folder: Path) -> Path:
    assert (response.status_code, response["Content-Type"]) == (200, "application/zip")
    with zipfile.ZipFile(io.BytesIO(b"".join(response.streaming_content))) as archive:
        assert archive.testzip() is None
        archive.extractall(folder)
    return folder


@pytest.mark.parametrize("address", ["/evaluations/{}/logs.zip", "/api/v1/evaluations/{}/logs/"])
def test_deepracer_utils_reads_the_unpacked_zip_as_it_is(alice, now, driven, tmp_path, client, as_racer, address):
    evaluation = finished(alice, now, driven)
    client.force_login(alice)
    by = as_racer(alice) if address.startswith("/api") else client
    response = by.get(address.format(evaluation.public_id))
    assert response["Content-Disposition"] == f'attachment; filename="{evaluation.public_id}-logs.zip"'
    log = community().DeepRacerLog(str(unpacked(response, tmp_path)))
    log.load_evaluation_trace()
    stream = f"{evaluation.ended_at:%Y%m%d%H%M%S}-{evaluation.public_id}"
    frame = log.dataframe()
    assert (len(frame), set(frame["stream"])) == (len(driven.trace), {stream})
    assert log.agent_and_network()["sensor_list"] == evaluation.spec["metadata"]["sensor"]
    assert log.action_space() == evaluation.spec["metadata"]["action_space"]
    # the first cells of the community's notebook Evaluation_analysis
    laps_of_it = community().AnalysisUtils.simulation_agg(frame, "stream", add_tstamp=True, is_eval=True)
    assert laps_of_it["progress"].tolist() == [100.0, 100.0]
    assert laps_of_it["time"].tolist() == pytest.approx([lap.time_ms / 1000 for lap in driven.laps], abs=0.14)
    community().AnalysisUtils.scatter_aggregates(laps_of_it, is_eval=True)
    # and its other way, from the log
    log.load_robomaker_logs(type=community().misc.LogType.EVALUATION, force=True)
    assert log.dataframe()[["x", "y", "yaw", "progress"]].equals(frame[["x", "y", "yaw", "progress"]])
    assert log.dataframe()["steps"].tolist() == frame["steps"].tolist()
    assert log.hyperparameters() == {}
    assert log.agent_and_network()["world"] == evaluation.track.slug


def test_every_car_has_a_stream_and_the_first_its_metadata(alice, bob, now, driven, tmp_path, client):
    evaluation = finished(alice, now, driven, rivals=[car_outcome(salt=1), car_outcome(salt=2)])
    client.force_login(bob)
    folder = unpacked(client.get(f"/evaluations/{evaluation.public_id}/logs.zip"), tmp_path / "bob")
    assert not (folder / "model").exists(), "what a car can do is its owner's"
    assert "action space" not in "".join(path.read_text() for path in folder.glob("logs/**/*.log"))
    log = community().DeepRacerLog(str(folder))
    log.load_evaluation_trace()
    name = f"{evaluation.ended_at:%Y%m%d%H%M%S}-{evaluation.public_id}"
    assert set(log.dataframe()["stream"]) == {name, f"{name}-car1", f"{name}-car2"}
    share_model(model=evaluation.model, now=now)
    shared = unpacked(client.get(f"/evaluations/{evaluation.public_id}/logs.zip"), tmp_path / "shared")
    assert (shared / "model" / "model_metadata.json").exists()


def test_a_run_without_a_result_has_no_zip(alice, now, client, as_racer):
    waiting = submit_model(race=a_race(now), racer=alice, model=a_model(alice), now=now).evaluation
    client.force_login(alice)
    assert client.get(f"/evaluations/{waiting.public_id}/logs.zip").status_code == 404
    answer = as_racer(alice).get(f"/api/v1/evaluations/{waiting.public_id}/logs/")
    assert (answer.status_code, answer.json()["code"]) == (404, "not_found")


def test_a_zip_with_a_lost_trace_is_refused_before_it_starts(alice, now, as_racer):
    evaluation = drive(a_race(now), alice, laps(10_000, 10_000, 10_000), now).evaluation
    trace = Result.objects.get(evaluation=evaluation).trace
    trace.storage.delete(trace.name)
    answer = as_racer(alice).get(f"/api/v1/evaluations/{evaluation.public_id}/logs/")
    assert (answer.status_code, answer.json()["code"]) == (503, "file_damaged")


def test_the_page_of_a_run_offers_the_zip(alice, now, client):
    evaluation = drive(a_race(now), alice, laps(10_000, 10_000, 10_000), now).evaluation
    client.force_login(alice)
    assert (
        f'href="/evaluations/{evaluation.public_id}/logs.zip"'
        in client.get(evaluation.get_absolute_url()).content.decode()
    )

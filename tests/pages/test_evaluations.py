"""The page of an evaluation while it waits, drives and is done."""

from __future__ import annotations

import re

from evaluation.models import Evaluation
from paddock.simulator.engine import ENGINE_ID
from tests.factories import finish, laps
from tests.pages.conftest import World


def polled(html: str) -> str:
    """The address that a page asks for what is new."""
    return re.search(r'hx-get="(/evaluations/\w+/live/\?seen=[^"]+)"', html)[1]


def page_of(world: World, name: str, viewer: str) -> str:
    return world.client(viewer).get(f"/evaluations/{getattr(world, name).evaluation.public_id}/").content.decode()


def test_a_waiting_run_shows_its_place_in_the_queue(world: World) -> None:
    html = page_of(world, "queued", "alice")
    assert "In queue: next." in html
    assert 'http-equiv="refresh"' in html, "without scripts the page still renews itself"
    assert "Stop" in html


def test_a_car_on_track_shows_lap_time_progress_and_map_position(world: World) -> None:
    html = page_of(world, "running", "bob")
    assert "Lap 2 / 3" in html and "0:04.000" in html
    assert 'value="47"' in html  # one lap and 40 percent of three
    assert 'id="live-dot"' in html


def test_the_fragment_is_sent_only_when_something_changed(world: World) -> None:
    client = world.client("bob")
    address = polled(page_of(world, "running", "bob"))
    assert client.get(address).status_code == 204
    evaluation = world.evaluation("running")
    Evaluation.objects.filter(pk=evaluation.pk).update(progress=evaluation.progress | {"lap": 3, "total_ms": 22_000})
    response = client.get(address)
    html = response.content.decode()
    assert response.status_code == 200 and "Lap 3 / 3" in html
    assert 'hx-swap-oob="true"' in html and 'data-say="On track, lap 3 of 3."' in html
    assert "no-store" in response["Cache-Control"]
    assert polled(html) != address


def test_the_last_fragment_is_the_whole_result(world: World) -> None:
    client = world.client("alice")
    address = polled(page_of(world, "queued", "alice"))
    finish(world.queued, laps(9_000, 9_100, 9_200), world.now)
    response = client.get(address)
    assert (response["HX-Retarget"], response["HX-Reswap"]) == ("#evaluation", "outerHTML")
    html = response.content.decode()
    assert html.lstrip().startswith('<div id="evaluation"')
    assert "0:09.000" in html and "data-viewer" in html and "hx-get" not in html


def test_a_result_shows_laps_sectors_files_and_proof(world: World) -> None:
    html = page_of(world, "finished", "anonymous")
    for text in ("0:10.000", "0:10.100", "0:10.200", "+0.100", "3.333", ENGINE_ID, "trace.csv", "metrics.json"):
        assert text in html, text
    assert world.finished.evaluation.result.trace_sha256 in html
    assert "sector-time purple" in html
    assert 'class="track-line' in html


def test_the_trajectory_is_coloured_by_speed_or_lap(world: World) -> None:
    path = f"/evaluations/{world.finished.evaluation.public_id}/"
    client = world.client("anonymous")
    by_speed = client.get(path).content.decode()
    by_lap = client.get(path + "?colour=lap").content.decode()
    one = client.get(path + "?colour=lap&lap=1").content.decode()
    assert re.search(r'class="track-line speed-\d"', by_speed)
    assert 'class="track-line lap-0"' in by_lap and 'class="track-line lap-1"' in by_lap
    assert 'class="track-line lap-0"' in one and 'class="track-line lap-1"' not in one


def test_a_failure_says_why_and_shows_its_code(world: World) -> None:
    html = page_of(world, "failed", "alice")
    assert "NaN or infinity in step 7" in html and 'data-code="non_finite_action"' in html
    assert "our fault" not in html


def test_a_failure_of_the_platform_says_that_it_does_not_count(world: World) -> None:
    html = page_of(world, "ours", "bob")
    assert 'data-code="platform_gave_up"' in html
    assert "It does not count as a submission" in html


def test_stopping_a_run_twice_changes_nothing(world: World) -> None:
    client = world.client("alice")
    path = f"/evaluations/{world.queued.evaluation.public_id}/"
    assert client.post(path + "stop/")["Location"] == path
    assert world.evaluation("queued").state == "stopped"
    assert client.post(path + "stop/").status_code == 302
    assert "stopped before its end" in client.get(path).content.decode()


def test_a_replay_is_the_trace_in_metres(world: World) -> None:
    path = f"/evaluations/{world.finished.evaluation.public_id}/replay.json"
    response = world.client("anonymous").get(path)
    run = response.json()
    assert (run["bots"], run["rivals"], run["boxes"]) == ([], [], [])
    columns = run["columns"]
    assert {len(column) for column in columns.values()} == {10}
    assert (columns["t"][0], columns["lap"][0]) == (0, 1) and columns["lap"][-1] > 1
    assert (columns["x"][0], columns["y"][0]) == (0.5, 0.0)
    again = world.client("anonymous").get(path, headers={"If-None-Match": response["ETag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_files_are_downloads_in_the_formats_of_the_field(world: World) -> None:
    path = f"/evaluations/{world.finished.evaluation.public_id}/"
    client = world.client("anonymous")
    trace = client.get(path + "trace.csv")
    assert trace["Content-Disposition"].startswith("attachment")
    assert trace.content.startswith(b"episode,steps,X,Y,yaw,steer,throttle,action,")
    metrics = client.get(path + "metrics.json")
    assert metrics["Content-Disposition"].startswith("attachment") and "metrics" in metrics.json()


def test_only_the_owner_sees_a_run_that_does_not_count(world: World) -> None:
    path = f"/evaluations/{world.other.evaluation.public_id}/"
    assert world.client("alice").get(path).status_code == 200
    assert world.client("bob").get(path + "live/").status_code == 404

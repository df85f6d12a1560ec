"""Pages of the training room: who sees what, what the wizard takes and refuses, what a training shows."""

from __future__ import annotations

import itertools
import json
import math
import re
from datetime import timedelta

import pytest
from django.test import Client
from django.utils.html import escape

from evaluation.models import Evaluation
from evaluation.templatetags.looks import shell_picture
from races.entries.services.entries import enter_race, remove_entry
from tests.factories import a_race
from tests.pages.conftest import VIEWERS, World
from tests.pages.test_pages import INLINE
from tests.rows import track_row
from tests.training.jobs import REWARD, a_training
from tracks.models import Track
from training.jobs.progress_graph import MOST_CLOUDS, draw_graph, points_of, smoothed
from training.lessons.catalogue import LESSONS
from training.models import JobState, TrainingIteration, TrainingJob, Vehicle
from training.templatetags.training import span

pytestmark = pytest.mark.usefixtures("trainings_taken_on")
MINE = ("/train/", "/train/new/", "/train/new/?clone=x&job=y&example=z&speed_max=fast", "/learn/laboratory/")
MINE += ("/vehicles/", "/vehicles/new/")
ACTS = ("stop", "evaluate")
OWNERS = {"anonymous": 302, "newcomer": 404, "alice": 200, "bob": 404, "admin": 200}


@pytest.fixture
def job(world: World) -> TrainingJob:
    """Alice's training, queued."""
    return a_training(world.alice, world.track, world.now, name="Lightning-2", description="Is it <b>fast</b>?")


def run(job: TrainingJob, iterations: int = 3) -> TrainingJob:
    """The same training after some iterations, still running."""
    for number in range(1, iterations + 1):
        TrainingIteration.objects.create(
            job=job,
            number=number,
            steps=2000 * number,
            seconds=2.0 * number,
            steps_per_second=1000.0,
            episodes=[
                {"episode": i, "reward": 10.0 * number + i, "progress": 20.0, "status": "Off track", "steps": 30}
                | {"start_ms": 0, "time_ms": 2000}
                for i in range(4)
            ],
            mean_reward=10.0 * number + 1.5,
            mean_progress=20.0 * number,
            eval_progress=min(30.0 * number, 100.0),
            eval_reward=40.0,
            eval_lap_ms=13_000 if number == iterations else None,
            entropy=1.5,
            policy_loss=-0.01,
            value_loss=0.2,
            is_best=number == iterations,
        )
    values = {"state": JobState.RUNNING, "lease": "12345678123456781234567812345678", "started_at": job.created_at}
    values |= {"leased_until": job.created_at + timedelta(seconds=30), "steps_done": 2000 * iterations}
    values |= {"driving": [[0.0, -1.8, 0.0, 1.2], [0.1, -1.8, 0.0, 1.3]], "log": "iteration 1\n", "seconds_done": 6.0}
    TrainingJob.objects.filter(pk=job.pk).update(**values)
    job.refresh_from_db()
    return job


def end(job: TrainingJob, world: World) -> TrainingJob:
    """The same training, finished with a model of alice's."""
    values = {
        "state": JobState.FINISHED,
        "ended_because": "time",
        "lease": None,
        "leased_until": None,
        "ended_at": world.now,
    }
    values |= {"best_model": world.model, "last_model": world.model}
    TrainingJob.objects.filter(pk=job.pk).update(**values)
    job.refresh_from_db()
    return job


def dots(html: str) -> int:
    """Episodes in the graph."""
    return sum(path.count("h0") for path in re.findall(r'class="graph-dots" d="([^"]*)"', html))


def form_of(client: Client, query: str = "", **changes: str) -> dict[str, str]:
    """What a browser sends from the wizard as it is shown, with changes."""
    html = client.get(f"/train/new/{query}")
    form = html.context["form"]
    sent: dict[str, str] = {}
    for name, field in form.fields.items():
        value = form.get_initial_for_field(field, name)
        if name == "actions":
            for number, action in enumerate(value, 1):
                sent[f"actions-{number}-steering"] = str(action["steering_angle"])
                sent[f"actions-{number}-speed"] = str(action["speed"])
        elif value is not None and value is not False and name != "boxes":
            sent[name] = str(field.prepare_value(value))
    return {**sent, "name": "New-one", **changes}


@pytest.mark.slow
def test_every_page_has_the_right_status_for_everybody(world: World, job: TrainingJob) -> None:
    job = end(run(job), world)
    vehicle = Vehicle.objects.create(owner=world.alice, name="Stereo")
    everybody = dict.fromkeys(VIEWERS, 200)
    mine = {**OWNERS, "admin": 404}
    pages = {
        **{path: everybody for path in ("/learn/", *(f"/learn/{lesson.slug}/" for lesson in LESSONS))},
        **{f"/learn/elsewhere/{rest}": everybody for rest in ("", "train_a_car.py", "train_a_car.ipynb")},
        "/learn/elsewhere/secrets.py": dict.fromkeys(VIEWERS, 404),
        "/learn/nothing/": dict.fromkeys(VIEWERS, 404),
        **{path: {**everybody, "anonymous": 302} for path in MINE},
        f"/vehicles/{vehicle.public_id}/": mine,
        f"/vehicles/{vehicle.public_id}/delete/": mine,
        **{f"/train/{job.public_id}/{rest}": OWNERS for rest in ("", "?smooth=9", "?smooth=x", "metrics.json")},
        **{f"/train/{job.public_id}/{rest}": OWNERS for rest in ("logs.zip", "best.zip", "last.zip")},
        f"/train/{job.public_id}/live/": OWNERS | {"alice": 204, "admin": 204},
        **{f"/train/{job.public_id}/{rest}/": {**dict.fromkeys(VIEWERS, 405), "anonymous": 302} for rest in ACTS},
        f"/train/{job.public_id}/sb3.zip": dict.fromkeys(VIEWERS, 404) | {"anonymous": 302},
        f"/train/{job.public_id}/trace.csv": dict.fromkeys(VIEWERS, 404) | {"anonymous": 302},
        "/train/nothing/": dict.fromkeys(VIEWERS, 404) | {"anonymous": 302},
    }
    wrong = []
    for viewer in VIEWERS:
        client = world.client(viewer)
        for path, expected in pages.items():
            response = client.get(path)
            if response.status_code != expected[viewer]:
                wrong.append((viewer, path, response.status_code, expected[viewer]))
            elif response["Content-Type"].startswith("text/html"):
                assert not INLINE.search(response.content.decode()), (path, INLINE.search(response.content.decode())[0])
    assert not wrong


def test_the_example_is_shown_and_downloaded_unchanged(world: World, settings) -> None:
    client = world.client("anonymous")
    source = (settings.BASE_DIR / "training/examples/train_a_car.py").read_bytes()
    answer = client.get("/learn/elsewhere/train_a_car.py")
    assert b"".join(answer.streaming_content) == source
    assert answer["Content-Disposition"] == 'attachment; filename="train_a_car.py"'
    assert escape(source.decode()) in client.get("/learn/elsewhere/").content.decode()
    for page in ("/learn/", "/about/"):
        assert 'href="/learn/elsewhere/"' in client.get(page).content.decode()


def test_the_training_pages_are_entirely_in_korean(world: World, job: TrainingJob) -> None:
    english = re.compile(r">[^<]*\b(the|your|you|is|of|and|has|with)\b[^<]*<", re.I)
    client = world.client("alice")
    client.cookies["django_language"] = "ko"
    job = run(job)
    TrainingJob.objects.filter(pk=job.pk).update(description="")
    paths = ["/train/", "/train/new/", "/vehicles/", "/vehicles/new/", "/learn/", "/learn/laboratory/"]
    paths.append("/learn/elsewhere/")
    for path in (*paths, *(f"/learn/{lesson.slug}/" for lesson in LESSONS), f"/train/{job.public_id}/"):
        body = re.sub(
            r"<(script|pre|code|textarea|template)\b.*?</\1>", "", client.get(path).content.decode(), flags=re.S
        )
        assert not english.search(body), (path, english.search(body)[0][:90])


def test_the_wizard_creates_the_training_it_shows(world: World, monkeypatch) -> None:
    monkeypatch.setattr("training.wizard.views.refusals", lambda *_: [])
    client = world.client("newcomer")
    response = client.post("/train/new/", form_of(client, stop_clean_laps="3", submit_to_race="open-race"))
    job = TrainingJob.objects.get(owner=world.newcomer)
    assert response["Location"] == job.get_absolute_url()
    assert (job.name, job.track.slug, job.stop_clean_laps, job.submit_to_race) == ("New-one", "oval", 3, world.race)
    assert len(job.action_space) == 5
    assert job.hyperparameters["lr"] == 1e-3
    assert "\r" not in job.reward_code


WRONG = {
    "name": ({"name": "no blanks"}, "hyphens"),
    "lr": ({"lr": "0.5"}, "from 1e-08 to 0.001"),
    "num_epochs": ({"num_epochs": "2"}, "from 3 to 10"),
    "stop_minutes": ({"stop_minutes": "1441"}, "1440"),
    "actions": ({"actions-1-steering": "-31"}, "from −30 to 30"),
    "action_space_type": ({"algorithm": "sac"}, "SAC needs ranges"),
    "speed_high": ({"action_space_type": "continuous", "speed_low": "3", "speed_high": "2"}, "less than"),
    "reward_code": ({"reward_code": ""}, "examples"),
    "vehicle": ({"vehicle": "somebodys"}, "garage"),
    "clone": ({"start": "model", "clone": "somebodys"}, ""),
    "random_boxes": ({"race_type": "object_avoidance", "random_boxes": "60"}, ""),
}


@pytest.mark.parametrize("field", WRONG)
def test_an_error_is_shown_at_its_field(world: World, field: str, monkeypatch) -> None:
    monkeypatch.setattr("training.wizard.views.refusals", lambda *_: [])
    client = world.client("newcomer")
    changes, words = WRONG[field]
    response = client.post("/train/new/", form_of(client, **changes))
    errors = response.context["form"].errors
    assert response.status_code == 422
    assert list(errors) == [field], errors
    assert words in str(errors[field])
    assert not TrainingJob.objects.filter(owner=world.newcomer).exists()


def test_a_taken_name_and_a_full_quota_are_reported(world: World, job: TrainingJob, settings, monkeypatch) -> None:
    monkeypatch.setattr("training.wizard.views.refusals", lambda *_: [])
    client = world.client("alice")
    assert "name" in client.post("/train/new/", form_of(client, name=job.name)).context["form"].errors
    settings.TRAINING_MINUTES_A_MONTH = 15
    response = client.post("/train/new/", form_of(client))
    assert "5" in str(response.context["form"].errors["stop_minutes"])
    settings.TRAININGS_AT_ONCE = 1
    response = client.post("/train/new/", form_of(client))
    assert response.context["form"].non_field_errors().as_data()[0].code == "training_jobs_at_once"


def test_the_pages_say_if_torch_is_missing(world: World, settings, monkeypatch) -> None:
    monkeypatch.setattr("training.wizard.views.refusals", lambda *_: [])
    settings.TRAINING = False
    client = world.client("alice")
    for path in ("/train/", "/train/new/", "/learn/agent/"):
        assert "Training is not installed on this site" in client.get(path).content.decode()
    for path in ("/train/", "/train/new/"):
        assert "Minutes left this month" in client.get(path).content.decode()
    response = client.post("/train/new/", form_of(client))
    assert response.status_code == 503


def test_granularities_fill_the_action_table_without_scripts(world: World) -> None:
    client = world.client("alice")
    sent = form_of(client, do="table", steering_granularity="3", speed_granularity="2", speed_max="2", name="")
    response = client.post("/train/new/", sent)
    assert response.status_code == 200
    html = response.content.decode()
    assert re.findall(r'name="actions-\d+-speed" value="([\d.]+)"', html) == ["1", "2"] * 3
    assert "errors" not in html.split("<main")[1].split('class="actions"')[0] or "wrong" not in html


@pytest.mark.slow
def test_the_editor_gets_lines_and_messages(world: World) -> None:
    client = world.client("alice")
    bad = client.post(
        "/train/validate/", {"reward_code": "def reward_function(params):\r\n    return params['x'] /\r\n"}
    )
    assert [(problem["line"], problem["code"]) for problem in bad.json()["problems"]] == [(2, "reward_syntax")]
    good = client.post("/train/validate/", {"reward_code": REWARD}).json()
    assert good["problems"] == []
    assert len(good["rewards"]) == 5
    response = client.post(
        "/train/new/", form_of(client, reward_code="import os\ndef reward_function(p):\n    return 1.0\n")
    )
    assert "Line 1" in str(response.context["form"].errors["reward_code"])
    assert world.client("anonymous").post("/train/validate/", {}).status_code == 302


def test_a_racer_runs_one_check_at_a_time(world: World, monkeypatch) -> None:
    from training.rewards.check_slots import one_check

    with one_check(world.alice):
        response = world.client("alice").post("/train/validate/", {"reward_code": REWARD})
    assert response.status_code == 409
    assert response.json()["problems"][0]["code"] == "reward_check_runs"


def test_a_running_training_shows_its_graph_and_trajectory(world: World, job: TrainingJob) -> None:
    client = world.client("alice")
    html = client.get(job.get_absolute_url()).content.decode()
    assert "appears when training starts" in html
    assert "data-drive-none>The car appears after the first evaluation." in html and "data-drive-some hidden>" in html
    run(job)
    html = client.get(job.get_absolute_url()).content.decode()
    assert "data-drive-none hidden>" in html and "data-drive-some>Latest evaluation" in html
    assert dots(html) == 12
    assert "&lt;b&gt;fast&lt;/b&gt;" in html
    drive = json.loads(re.search(r'id="training-graph"[^>]*data-drive="([^"]*)"', html)[1])
    assert len(drive) == 2 and drive[0][3] == 1.2
    live = client.get(f"/train/{job.public_id}/live/")
    assert 'hx-swap-oob="true"' in live.content.decode()
    seen = live.context["mark"]
    assert client.get(f"/train/{job.public_id}/live/", {"seen": seen}).status_code == 204
    TrainingJob.objects.filter(pk=job.pk).update(progress={"steps": 6500, "seconds": 7.0})
    figures = client.get(f"/train/{job.public_id}/live/", {"seen": seen})
    html = figures.content.decode()
    assert "6.5 k" in html and "<svg" not in html, "no iteration came"
    seen = figures.context["mark"]
    TrainingIteration.objects.filter(number=3).delete()
    TrainingIteration.objects.create(job=job, number=3, steps=6600, seconds=8, eval_progress=77.0, eval_reward=1.0)
    again = client.get(f"/train/{job.public_id}/live/", {"seen": seen}).content.decode()
    assert dots(again) == 8 and 'id="training-graph"' in again, "the number is the same, the iteration another"
    assert 'id="printed-lines"' not in again, "nothing was printed"
    TrainingJob.objects.filter(pk=job.pk).update(printed="step 7 <script>\n")
    printed = client.get(f"/train/{job.public_id}/live/", {"seen": seen}).content.decode()
    assert (
        "step 7 &lt;script&gt;" in printed
        and "step 7 &lt;script&gt;" in client.get(job.get_absolute_url()).content.decode()
    )
    end(job, world)
    over = client.get(f"/train/{job.public_id}/live/", {"seen": seen})
    assert (over.status_code, over["HX-Refresh"]) == (204, "true")


def test_only_its_owner_and_admins_stop_a_training(world: World, job: TrainingJob) -> None:
    for viewer, status in {"bob": 404, "newcomer": 404}.items():
        assert world.client(viewer).post(f"/train/{job.public_id}/stop/").status_code == status
    job.refresh_from_db()
    assert job.state == JobState.QUEUED
    assert world.client("alice").post(f"/train/{job.public_id}/stop/").status_code == 302
    job.refresh_from_db()
    assert job.state == JobState.STOPPED


def test_only_its_owner_evaluates_a_finished_model(world: World, job: TrainingJob) -> None:
    end(run(job), world)
    before = Evaluation.objects.count()
    assert world.client("admin").post(f"/train/{job.public_id}/evaluate/").status_code == 404
    response = world.client("alice").post(f"/train/{job.public_id}/evaluate/")
    assert response.status_code == 302
    assert Evaluation.objects.count() == before + 1
    rules = Evaluation.objects.latest("queued_at").spec["rules"]
    assert (rules["laps"], rules["race_type"], rules["direction"]) == (3, "time_trial", "ccw")


def test_continued_training_copies_settings_weights_and_vehicle(world: World, job: TrainingJob) -> None:
    TrainingJob.objects.filter(pk=job.pk).update(
        stop_minutes=7, reward_code="def reward_function(params):\n    return 7.0\n"
    )
    end(run(job), world)
    client = world.client("alice")
    form = client.get("/train/new/", {"job": job.public_id, "clone": world.model.public_id}).context["form"]
    assert form.initial["stop_minutes"] == 7
    assert "return 7.0" in form.initial["reward_code"]
    assert form.initial["clone"] == world.model.public_id
    stranger = world.client("bob").get("/train/new/", {"job": job.public_id, "clone": world.model.public_id})
    assert "clone" not in stranger.context["form"].initial
    assert "return 7.0" not in stranger.content.decode()


def test_races_the_racer_may_not_enter_are_not_offered(world: World) -> None:
    def offered() -> set[str]:
        form = world.client("newcomer").get("/train/new/").context["form"]
        return {race.slug for race in form.fields["submit_to_race"].offered}

    pros = a_race(world.now, kind="league", division="pro")
    everybodys = a_race(world.now, kind="league", division="all")
    assert pros.slug not in offered() and {everybodys.slug, "open-race"} <= offered()
    entry = enter_race(race=world.race, racer=world.newcomer, now=world.now)
    remove_entry(entry=entry, by=world.alice, now=world.now, reason="Rude")
    assert "open-race" not in offered()


def test_the_original_vehicle_is_offered_first(world: World, job: TrainingJob) -> None:
    Vehicle.objects.create(owner=world.alice, name="A stereo", sensors=["STEREO_CAMERAS"])
    form = world.client("alice").get("/train/new/").context["form"]
    assert next(str(value) for value, _ in form.fields["vehicle"].choices) == "" and not form["vehicle"].value()
    again = world.client("alice").get("/train/new/", {"job": job.public_id}).context["form"]
    assert again["vehicle"].value() == ""
    cloned = world.client("alice").get("/train/new/", {"clone": world.model.public_id}).context
    assert cloned["form"]["vehicle"].value() == "" and cloned["lacking"] is None


def test_vehicles_can_be_added_changed_and_deleted(world: World) -> None:
    client = world.client("alice")
    sent = {"name": "Owl", "camera": "STEREO_CAMERAS", "lidar": "DISCRETIZED_SECTOR_LIDAR", "num_sectors": "8"}
    sent |= {"num_values_per_sector": "4", "clipping_dist": "1.5", "shell": "buggy", "colour": "#12A15B"}
    sent |= {"neural_network": "DEEP_CONVOLUTIONAL_NETWORK"}
    assert client.post("/vehicles/new/", sent).status_code == 302
    owl = Vehicle.objects.get(owner=world.alice)
    assert owl.sensors == ["STEREO_CAMERAS", "DISCRETIZED_SECTOR_LIDAR"]
    assert owl.lidar_config == {"num_sectors": 8, "num_values_per_sector": 4, "clipping_dist": 1.5}
    assert (owl.shell, owl.colour) == ("buggy", "#12a15b")
    assert "Owl" in client.get("/vehicles/").content.decode()
    assert "name" in client.post("/vehicles/new/", sent).context["form"].errors
    assert client.post("/vehicles/new/", sent | {"name": "B", "colour": "red"}).status_code == 422
    assert client.post(f"/vehicles/{owl.public_id}/", sent | {"name": "Barn owl", "lidar": ""}).status_code == 302
    owl.refresh_from_db()
    assert (owl.name, owl.sensors, owl.lidar_config) == ("Barn owl", ["STEREO_CAMERAS"], {})
    assert world.client("bob").post(f"/vehicles/{owl.public_id}/delete/").status_code == 404
    assert client.post(f"/vehicles/{owl.public_id}/delete/").status_code == 302
    assert not Vehicle.objects.exists()


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_the_inner_pilot_drives_inside_in_both_directions(world: World, direction: str) -> None:
    """Inside of the oval: nearer to its middle."""
    from training.rewards.laboratory.views import LabForm, _drive

    middle = Track.objects.get(slug="oval").geometry.centre.mean(axis=0)
    far = {}
    for drive in ("inner", "pilot", "outer"):
        form = LabForm(
            {"track": "oval", "direction": direction, "drive": drive, "reward_code": REWARD}, owner=world.alice
        )
        assert form.is_valid()
        states = _drive(form)[1][30:]
        far[drive] = sum(math.dist((state["x"], state["y"]), middle) for state in states) / len(states)
    assert far["inner"] < far["pilot"] < far["outer"]


def test_the_graph_works_for_one_iteration_and_for_thousands(world: World, job: TrainingJob) -> None:
    assert draw_graph([]) == ""
    one = points_of(run(job, 1), job.iterations.last())
    assert draw_graph(one).count("<polyline") == 3
    many = draw_graph(one * 5000, 9)
    assert 1000 < dots(many) <= 1500
    assert len(json.loads(re.search(r'data-points="([^"]*)"', many)[1].replace("&quot;", '"'))) <= 601


def test_a_long_training_draws_episodes_of_some_iterations(job: TrainingJob) -> None:
    run(job, 2 * MOST_CLOUDS + 1)
    points = points_of(job, job.iterations.order_by("number").last())
    assert len(points) == 2 * MOST_CLOUDS + 1
    drawn = [point.number for point in points if point.rewards]
    assert MOST_CLOUDS / 2 < len(drawn) <= MOST_CLOUDS
    assert {later - before for before, later in itertools.pairwise(drawn)} == {3}


def test_smoothing_is_a_moving_average() -> None:
    assert smoothed([1.0, 3.0, None, 5.0], 3) == [1.0, 2.0, None, 4.0]
    assert smoothed([1.0, 2.0], 1) == [1.0, 2.0]


def test_times_and_pictures_are_formatted_safely() -> None:
    assert [span(59.6), span(3661), span(None)] == ["1:00", "1:01:01", "0:00"]
    picture = shell_picture("kart", '"><script>', "A kart")
    assert "<script>" not in picture and 'aria-label="A kart"' in picture


def test_races_similar_to_the_training_are_offered_first(world: World, job: TrainingJob) -> None:
    """And said to be so, on the training's page and on the model's."""
    elsewhere = track_row("kuei-raceway")
    boxes = {"race_type": "object_avoidance", "random_boxes": 3, "closes_at": world.now + timedelta(hours=1)}
    a_race(world.now, track=job.track, name="Boxes here", **boxes)
    a_race(world.now, track=elsewhere, name="Trial elsewhere", closes_at=world.now + timedelta(hours=2))
    like = a_race(world.now, track=job.track, name="Just like it", closes_at=world.now + timedelta(days=90))
    job = end(run(job), world)
    body = world.client("alice").get(f"/train/{job.public_id}/").content.decode()
    assert body.index(like.name) < body.index("Other races") < body.index("Boxes here")
    assert body.index("Boxes here") < body.index("Trial elsewhere")
    body = world.client("alice").get(job.best_model.get_absolute_url()).content.decode()
    assert body.index(like.name) < body.rindex("as in training") < body.index("Boxes here")


def test_the_package_is_offered_where_it_was_built(world: World, settings, tmp_path) -> None:
    client, page = world.client("anonymous"), "/learn/elsewhere/"
    settings.BASE_DIR = tmp_path
    assert "make package" in client.get(page).content.decode()
    wheel = "paddock_racing-0.1.0-py3-none-linux_x86_64.whl"
    (tmp_path / "dist").mkdir()
    for name in (wheel, "paddock_racing-0.1.0.tar.gz", "notes.whl"):
        (tmp_path / "dist" / name).write_bytes(name.encode())
    body = client.get(page).content.decode()
    assert f"paddock-racing[training] @ http://testserver{page}{wheel}" in body and "notes.whl" not in body
    assert "deepracer" not in body
    names = "paddock_deepracer-0.1.0-py3-none-any.whl"
    (tmp_path / "dist" / names).write_bytes(b"names")
    assert f"paddock-deepracer @ http://testserver{page}{names}" in client.get(page).content.decode()
    assert b"".join(client.get(page + names).streaming_content) == b"names"
    answer = client.get(page + wheel)
    assert b"".join(answer.streaming_content) == wheel.encode()
    assert client.get(f"{page}notes.whl").status_code == 404


def test_the_wizard_reports_all_problems_at_once(world: World, job: TrainingJob, monkeypatch) -> None:
    client = world.client("alice")
    sent = form_of(client, name=job.name, reward_code="import os", stop_minutes="x")
    answer = client.post("/train/new/", sent)
    assert answer.status_code == 422
    assert set(answer.context["form"].errors) == {"name", "reward_code", "stop_minutes"}
    whole = client.post("/train/new/", sent | {"stop_minutes": "10"})
    assert set(whole.context["form"].errors) == {"name", "reward_code"}

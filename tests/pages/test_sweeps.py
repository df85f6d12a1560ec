"""Pages of sweeps: the part of the wizard, the table of trials, stopping and deleting."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from django.test import Client

from paddock.errors import UserFault
from tests.pages.conftest import VIEWERS, World
from tests.pages.test_training import form_of
from tests.training.jobs import a_sweep_row, a_training
from training.models import JobState, Sweep, SweepState, SweepTrial, TrainingIteration, TrainingJob
from training.rewards.examples import EXAMPLES

pytest.importorskip("optuna", reason="training is not installed: make training")
pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _checked(trainings_taken_on, monkeypatch) -> Iterator[None]:
    monkeypatch.setattr("training.wizard.views.refusals", lambda *_: [])
    monkeypatch.setattr("training.wizard.sweep.refusals", lambda *_: [])
    yield


def sweep_form(client: Client, **changes) -> dict:
    """What a browser sends that presses "Try these settings"."""
    tried = client.get("/train/new/?sweep=1").context["tried"]
    sent: dict = {}
    for name, field in tried.fields.items():
        value = tried.get_initial_for_field(field, name)
        if value is not None:
            sent[f"sweep-{name}"] = value if isinstance(value, list) else str(field.prepare_value(value))
    named = {f"sweep-{name}": value for name, value in changes.items() if name in tried.fields}
    rest = {name: value for name, value in changes.items() if name not in tried.fields}
    return {**form_of(client, "?sweep=1", do="sweep", **rest), **sent, **named}


def a_finished_sweep(world: World) -> Sweep:
    """Four trials on the oval, of which the third was the best and lapped."""
    sweep = a_sweep_row(world.alice, world.track, world.now, settings_count=4)
    first = sweep.trials.get().job
    rates = (1e-4, 3e-4, 5e-4, 9e-4)
    for number, (lr, progress) in enumerate(zip(rates, (20.0, 60.0, 100.0, 40.0), strict=True), start=1):
        job = first if number == 1 else a_training(world.alice, world.track, world.now, name=f"tune-{number}")
        for at in (1, 2, 3):
            TrainingIteration.objects.create(
                job=job,
                number=at,
                steps=100 * at,
                seconds=5.0 * at,
                eval_progress=progress * at / 3,
                eval_reward=1.0,
                eval_lap_ms=9_500 if progress * at / 3 == 100.0 else None,
                is_best=at == 3,
            )
        ended = {"state": JobState.FINISHED, "ended_because": "time", "ended_at": world.now, "steps_done": 300}
        columns = {**ended, "stop_seconds": 15.0, "seconds_done": 15.0, "keeps_models": number == 3}
        TrainingJob.objects.filter(pk=job.pk).update(**columns, best_model=world.model if number == 3 else None)
        setting = {"hyperparameters": {"lr": lr}, "action_space": 0, "reward_function": 0}
        results = [{"seconds": 15.0, "progress": progress, "lap_ms": 9_500 if progress == 100.0 else None}]
        SweepTrial.objects.update_or_create(
            sweep=sweep, number=number, defaults={"setting": setting, "job": job, "results": results}
        )
    best = sweep.trials.get(number=3)
    Sweep.objects.filter(pk=sweep.pk).update(state=SweepState.FINISHED, best=best, ended_at=world.now)
    sweep.refresh_from_db()
    return sweep


def test_the_wizard_begins_a_sweep(world: World) -> None:
    client = world.client("newcomer")
    choices = {"vary": ["lr", "batch_size", "loss_type"], "speeds": ["1.5"], "rewards": [EXAMPLES[1].slug]}
    response = client.post("/train/new/", sweep_form(client, settings="5", budget_minutes="2.5", **choices))
    assert response.status_code == 302, (response.context["form"].errors, response.context["tried"].errors)
    sweep = Sweep.objects.get(owner=world.newcomer)
    assert response["Location"] == sweep.get_absolute_url()
    assert (sweep.name, sweep.settings_count, sweep.budget_s) == ("New-one", 5, 150)
    assert sweep.space["hyperparameters"] == {
        "lr": {"low": 1e-4, "high": 1e-3},
        "batch_size": {"choices": [32, 64, 128, 256]},
        "loss_type": {"choices": ["huber", "mean squared error"]},
    }
    assert [max(one["speed"] for one in space["action_space"]) for space in sweep.space["action_spaces"]] == [1.4, 2.1]
    assert sweep.space["reward_functions"][1] == EXAMPLES[1].code
    job = sweep.trials.get().job
    assert (job.name, job.track, job.hyperparameters["lr"]) == ("New-one-1", world.track, 1e-3)
    assert "Sweep queued" in client.get(response["Location"]).content.decode()


WRONG = {
    "settings": ({"settings": "13"}, "tried", "12"),
    "budget_minutes": ({"budget_minutes": "0.2"}, "tried", "seconds"),
    "vary": ({"vary": []}, "tried", "Choose what"),
    "lr_low": ({"lr_low": "0.5"}, "tried", "from 1e-08 to 0.001"),
    "lr_high": ({"lr_high": "x"}, "tried", "number"),
    "batch_size_low": ({"vary": ["batch_size"], "batch_size_low": "33"}, "tried", "one of"),
    "rewards": ({"rewards": ["nothing"]}, "tried", "nothing"),
    "name": ({"name": "x" * 60}, "form", "58"),
    "reward_code": ({"reward_code": ""}, "form", "examples"),
}


@pytest.mark.parametrize("field", WRONG)
def test_an_error_is_shown_at_its_field(world: World, field: str) -> None:
    client = world.client("newcomer")
    changes, which, words = WRONG[field]
    response = client.post("/train/new/", sweep_form(client, **changes))
    errors = response.context[which].errors
    assert response.status_code == 422
    assert list(errors) == [field], (response.context["form"].errors, response.context["tried"].errors)
    assert words in str(errors[field])
    html = response.content.decode()
    assert re.search(r'<section class="card pad" id="sweep"><details class="more" open>', html)
    assert not Sweep.objects.exists() and not TrainingJob.objects.filter(owner=world.newcomer).exists()


def test_a_range_upside_down_is_refused(world: World) -> None:
    client = world.client("newcomer")
    response = client.post("/train/new/", sweep_form(client, lr_low="0.001", lr_high="0.0001"))
    assert response.context["tried"].errors["lr_low"].as_data()[0].code == "sweep_range"


def test_a_bad_reward_function_among_the_others_is_refused(world: World, monkeypatch) -> None:
    bad = {EXAMPLES[1].code: [UserFault("reward_length", length=0, limit=1)]}
    monkeypatch.setattr("training.wizard.sweep.refusals", lambda _owner, code, _type: bad.get(code, []))
    client = world.client("newcomer")
    response = client.post("/train/new/", sweep_form(client, rewards=[EXAMPLES[1].slug]))
    assert list(response.context["tried"].errors) == ["rewards"]


def test_a_full_month_stands_beside_the_budget(world: World, settings) -> None:
    settings.TRAINING_MINUTES_A_MONTH = 5
    client = world.client("newcomer")
    response = client.post("/train/new/", sweep_form(client))
    assert response.context["tried"].errors["budget_minutes"].as_data()[0].code == "training_minutes_left"


def test_one_training_ignores_the_part_for_sweeps(world: World) -> None:
    client = world.client("newcomer")
    sent = sweep_form(client, settings="99") | {"do": ""}
    assert (
        client.post("/train/new/", sent)["Location"] == TrainingJob.objects.get(owner=world.newcomer).get_absolute_url()
    )
    assert not Sweep.objects.exists()


def test_a_finished_sweep_shows_its_trials(world: World) -> None:
    sweep = a_finished_sweep(world)
    html = world.client("alice").get(sweep.get_absolute_url()).content.decode()
    assert [
        re.sub(r"\s+", " ", re.sub("<[^>]+>", " ", row)).split() for row in re.findall("<tr class.*?</tr>", html, re.S)
    ] == [
        ["1", "0.0001", "1", "/", "2", "0:15", "20", "%", "–", "pruned"],
        ["2", "0.0003", "1", "/", "2", "0:15", "60", "%", "–", "pruned"],
        ["3", "0.0005", "1", "/", "2", "0:15", "100", "%", "0:09.500", "best"],
        ["4", "0.0009", "1", "/", "2", "0:15", "40", "%", "–", "pruned"],
    ]
    assert html.count('class="sweep-trial') == 4 and 'class="sweep-trial best"' in html
    assert 'class="sweep-chart"' in html and "<progress" in html
    assert world.model.get_absolute_url() in html
    assert "/delete/" in html and "/stop/" not in html


def test_a_trials_page_leads_back_to_its_sweep(world: World) -> None:
    sweep = a_finished_sweep(world)
    html = world.client("alice").get(sweep.trials.get(number=2).job.get_absolute_url()).content.decode()
    assert f'href="{sweep.get_absolute_url()}"' in html
    assert "Time of this rung used (15 s)" in html
    assert "Delete this training" not in html


def test_a_sweep_that_waits_shows_its_plan(world: World) -> None:
    sweep = a_sweep_row(world.alice, world.track, world.now)
    client = world.client("alice")
    html = client.get(sweep.get_absolute_url()).content.decode()
    assert "Stop the sweep" in html and "Appears after three settings" in html and "sweep-chart" not in html
    assert f'href="{sweep.get_absolute_url()}"' in client.get("/train/").content.decode()


def test_only_its_owner_and_admins_see_and_stop_a_sweep(world: World) -> None:
    sweep = a_sweep_row(world.alice, world.track, world.now)
    at = sweep.get_absolute_url()
    expected = {viewer: 404 for viewer in VIEWERS} | {"anonymous": 302, "alice": 200, "admin": 200}
    for viewer in VIEWERS:
        assert world.client(viewer).get(at).status_code == expected[viewer], viewer
        if expected[viewer] != 200:
            assert world.client(viewer).post(f"{at}stop/").status_code == expected[viewer], viewer
        assert world.client(viewer).post(f"{at}delete/").status_code == (302 if viewer == "anonymous" else 404), viewer
    assert world.client("admin").post(f"{at}stop/").status_code == 302
    sweep.refresh_from_db()
    assert sweep.state == SweepState.STOPPED
    assert world.client("admin").get(f"{at}delete/").status_code == 404
    client = world.client("alice")
    assert client.get(f"{at}delete/").status_code == 200
    assert client.post(f"{at}delete/")["Location"] == "/train/"
    assert not Sweep.objects.exists()


def test_the_pages_are_entirely_in_korean(world: World) -> None:
    english = re.compile(r">[^<]*\b(the|your|you|is|of|and|has|with|trial|setting)\b[^<]*<", re.I)
    sweep = a_finished_sweep(world)
    client = world.client("alice")
    client.cookies["django_language"] = "ko"
    for path in (sweep.get_absolute_url(), f"{sweep.get_absolute_url()}delete/", "/train/", "/train/new/?sweep=1"):
        body = re.sub(
            r"<(script|pre|code|textarea|template)\b.*?</\1>", "", client.get(path).content.decode(), flags=re.S
        )
        assert not english.search(body), (path, english.search(body)[0][:90])


def test_queries_of_the_page_do_not_grow(world: World, django_assert_max_num_queries) -> None:
    sweep = a_finished_sweep(world)
    client = world.client("alice")
    client.get(sweep.get_absolute_url())
    with django_assert_max_num_queries(14):
        client.get(sweep.get_absolute_url())

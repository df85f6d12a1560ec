"""Who chooses SAC gets SAC's usual hyperparameters, and keeps what was typed."""

from __future__ import annotations

import re

import pytest

from tests.pages.conftest import World
from tests.pages.test_training import form_of
from training import tasks
from training.hyperparameters import DEFAULTS, RANGES
from training.models import TrainingJob

NUMBERS = [name for name in RANGES if name in DEFAULTS["ppo"] and name in DEFAULTS["sac"] and name != "batch_size"]


def page(world: World, query: str = "") -> str:
    return world.client("alice").get(f"/train/new/{query}").content.decode()


def shown(html: str, name: str) -> float:
    (tag,) = re.findall(rf'<input[^>]* name="{name}"[^>]*>', html)
    return float(re.search(r'value="([^"]*)"', tag)[1])


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
@pytest.mark.parametrize("name", NUMBERS)
def test_the_wizard_shows_what_is_usual_for_the_algorithm_that_an_address_names(world, algorithm, name):
    assert shown(page(world, f"?algorithm={algorithm}"), name) == DEFAULTS[algorithm][name]


def test_what_an_address_says_comes_before_what_is_usual(world):
    html = page(world, "?algorithm=sac&num_epochs=9")
    assert shown(html, "num_epochs") == 9
    assert '<option value="64" selected>' in html


def test_each_field_tells_the_script_what_is_usual(world):
    html = page(world)
    for name in (*NUMBERS, "batch_size", "loss_type"):
        (tag,) = re.findall(rf'<(?:input|select)[^>]* name="{name}"[^>]*>', html)
        for algorithm in ("ppo", "sac"):
            said = re.search(rf'data-{algorithm}="([^"]*)"', tag)[1]
            usual = DEFAULTS[algorithm][name]
            assert said == usual if isinstance(usual, str) else float(said) == usual


class TestWithoutAScript:
    """A browser sends what the page shows, whichever algorithm is chosen."""

    @pytest.fixture
    def made(self, world, settings, monkeypatch):
        """Send the wizard as it is shown but for ``changes``; the training that it makes."""
        settings.TRAINING, settings.TRAINING_PAUSED = True, False
        monkeypatch.setattr("training.views.wizard.refusals", lambda *_: [])
        monkeypatch.setattr(tasks.train, "apply_async", lambda **_options: None)

        def send(query: str = "", **changes: str) -> TrainingJob:
            sent = form_of(world.client("alice"), query, action_space_type="continuous", **changes)
            answer = world.client("alice").post("/train/new/", sent)
            assert answer.status_code == 302, answer.context["form"].errors
            return TrainingJob.objects.get(name=sent["name"])

        return send

    @pytest.mark.parametrize(("query", "chosen"), [("", "sac"), ("?algorithm=sac", "ppo"), ("", "ppo")])
    def test_what_is_left_as_it_was_is_what_is_usual_for_the_algorithm(self, made, query, chosen):
        assert made(query, algorithm=chosen).hyperparameters == DEFAULTS[chosen]

    def test_what_was_changed_stays(self, made):
        job = made(algorithm="sac", batch_size="128", lr="0.0003")
        assert job.hyperparameters == {**DEFAULTS["sac"], "batch_size": 128, "lr": 0.0003}

    def test_what_is_usual_elsewhere_may_be_chosen_where_the_page_shows_the_algorithm(self, made):
        usual = DEFAULTS["ppo"]["batch_size"]
        assert made("?algorithm=sac", batch_size=str(usual)).hyperparameters["batch_size"] == usual

    def test_a_refused_form_shows_what_it_would_take(self, world):
        sent = form_of(world.client("alice"), name="not a name", algorithm="sac", action_space_type="continuous")
        page = world.client("alice").post("/train/new/", sent).content.decode()
        assert shown(page, "num_epochs") == DEFAULTS["sac"]["num_epochs"]
        assert 'name="usual_of" value="sac"' in page

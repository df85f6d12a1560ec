"""Who chooses SAC gets SAC's usual hyperparameters, and keeps what was typed."""

from __future__ import annotations

import re
from datetime import timedelta

import pytest

from paddock.rules.hyperparameters import DEFAULTS, HYPERPARAMETERS
from tests.factories import a_race
from tests.pages.conftest import World
from tests.pages.test_training import form_of
from tests.rows import track_row
from training.models import TrainingJob

SOON = timedelta(hours=1)
NUMBERS = [
    name for name, one in HYPERPARAMETERS.items() if len(one.usual) == 2 and name not in ("batch_size", "loss_type")
]


def page(world: World, query: str = "") -> str:
    return world.client("alice").get(f"/train/new/{query}").content.decode()


def shown(html: str, name: str) -> float:
    (tag,) = re.findall(rf'<input[^>]* name="{name}"[^>]*>', html)
    return float(re.search(r'value="([^"]*)"', tag)[1])


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
@pytest.mark.parametrize("name", NUMBERS)
def test_the_wizard_shows_defaults_of_the_algorithm_in_the_url(world, algorithm, name):
    assert shown(page(world, f"?algorithm={algorithm}"), name) == DEFAULTS[algorithm][name]


def test_values_in_the_url_override_the_defaults(world):
    html = page(world, "?algorithm=sac&num_epochs=9")
    assert shown(html, "num_epochs") == 9
    assert '<option value="64" selected>' in html


def test_each_field_carries_its_defaults_for_the_script(world):
    html = page(world)
    for name in (*NUMBERS, "batch_size", "loss_type"):
        (tag,) = re.findall(rf'<(?:input|select)[^>]* name="{name}"[^>]*>', html)
        for algorithm in ("ppo", "sac"):
            said = re.search(rf'data-{algorithm}="([^"]*)"', tag)[1]
            usual = DEFAULTS[algorithm][name]
            assert said == usual if isinstance(usual, str) else float(said) == usual


class TestWithoutAScript:
    """A browser sends what the page shows, whichever algorithm is chosen."""

    @pytest.mark.parametrize("algorithm", ["ppo", "sac"])
    def test_buttons_take_the_consoles_values_and_ours(self, world, algorithm):
        client = world.client("alice")
        sent = form_of(client, algorithm=algorithm, num_epochs="9", name="Mine")
        for button, value in (("console", "console"), ("usual", "usual")):
            html = client.post("/train/new/", {**sent, "do": button}).content.decode()
            for name in NUMBERS:
                assert shown(html, name) == getattr(HYPERPARAMETERS[name], value)[algorithm]
            assert 'value="Mine"' in html
        assert not TrainingJob.objects.exists()

    @pytest.fixture
    def made(self, world, trainings_taken_on, monkeypatch):
        """Send the wizard as it is shown but for ``changes``; the training that it makes."""
        monkeypatch.setattr("training.wizard.views.refusals", lambda *_: [])

        def send(query: str = "", **changes: str) -> TrainingJob:
            sent = form_of(world.client("alice"), query, action_space_type="continuous", **changes)
            answer = world.client("alice").post("/train/new/", sent)
            assert answer.status_code == 302, answer.context["form"].errors
            return TrainingJob.objects.get(name=sent["name"])

        return send

    @pytest.mark.parametrize(("query", "chosen"), [("", "sac"), ("?algorithm=sac", "ppo"), ("", "ppo")])
    def test_unchanged_fields_get_the_algorithms_defaults(self, made, query, chosen):
        assert made(query, algorithm=chosen).hyperparameters == DEFAULTS[chosen]

    def test_changed_fields_keep_their_values(self, made):
        job = made(algorithm="sac", batch_size="512", lr="0.0003")
        assert job.hyperparameters == {**DEFAULTS["sac"], "batch_size": 512, "lr": 0.0003}

    def test_the_other_algorithms_default_may_be_chosen(self, made):
        usual = DEFAULTS["ppo"]["batch_size"]
        assert made("?algorithm=sac", batch_size=str(usual)).hyperparameters["batch_size"] == usual

    def test_a_refused_form_shows_the_new_algorithms_defaults(self, world):
        sent = form_of(world.client("alice"), name="not a name", algorithm="sac", action_space_type="continuous")
        page = world.client("alice").post("/train/new/", sent).content.decode()
        assert shown(page, "num_epochs") == DEFAULTS["sac"]["num_epochs"]
        assert 'name="usual_of" value="sac"' in page


def test_the_wizard_lists_similar_races_first(world):
    elsewhere = a_race(world.now, track=track_row("kuei-raceway"), name="Elsewhere", closes_at=world.now + SOON)
    boxes = {"race_type": "object_avoidance", "random_boxes": 3}
    here = a_race(world.now, track=world.track, name="Boxes here", closes_at=world.now + SOON, **boxes)

    def offered(query: str) -> list[str]:
        (select,) = re.findall(r'<select name="submit_to_race".*?</select>', page(world, query), re.S)
        return re.findall(r'value="([^"]+)"', select)

    names = offered("")
    assert names.index("open-race") < names.index(here.slug) < names.index(elsewhere.slug)
    assert offered("?track=kuei-raceway")[0] == elsewhere.slug
    assert offered("?race_type=object_avoidance")[0] == here.slug
    assert 'data-drives="kuei-raceway time_trial ccw"' in page(world)


@pytest.mark.parametrize(
    "query",
    [
        "?race_type=object_avoidance",
        "?race_type=object_avoidance&random_boxes=4&seed=7",
        "?race_type=object_avoidance&random_boxes=many&seed=x",
        "?race_type=head_to_head",
        "?race_type=head_to_head&bots=2&bot_speed_mps=fast&bot_lane_changes=on",
        "?race_type=rally&direction=up&track=nowhere",
    ],
)
def test_the_url_may_ask_for_any_layout(world, query):
    assert 'id="where"' in page(world, query)

"""The lessons and the laboratory of reward functions."""

from __future__ import annotations

import pytest
from django.test import Client

from tests.pages.conftest import World
from tests.pages.test_training import form_of
from tests.training.jobs import REWARD
from training.lessons import views as learn
from training.lessons.catalogue import LESSONS
from training.models import TrainingJob


def test_every_lesson_is_written_in_every_language(world: World, settings) -> None:
    assert set(learn.WRITTEN_IN) == {code for code, _name in settings.LANGUAGES}
    texts = set()
    for language in learn.WRITTEN_IN:
        client = Client()
        client.cookies["django_language"] = language
        texts |= {client.get(f"/learn/{lesson.slug}/").content for lesson in LESSONS}
    assert len(texts) == len(learn.WRITTEN_IN) * len(LESSONS)


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.slug)
def test_what_a_lesson_proposes_is_accepted(world: World, lesson, monkeypatch) -> None:
    monkeypatch.setattr("training.wizard.views.refusals", lambda *_: [])
    client = world.client("newcomer")
    for _label, query in lesson.tries:
        TrainingJob.objects.all().delete()
        name = dict(part.split("=") for part in query.split("&"))["name"]
        response = client.post("/train/new/", form_of(client, f"?{query}", name=name))
        assert response.status_code == 302, response.context["form"].errors
        assert TrainingJob.objects.get().name == name


@pytest.mark.slow
def test_the_laboratory_compares_two_reward_functions(world: World) -> None:
    client = world.client("alice")
    sent = {"track": "oval", "direction": "ccw", "drive": "inner", "reward_code": REWARD}
    first = client.post("/learn/laboratory/", sent, headers={"HX-Request": "true"})
    assert first.context["points"] > 100
    assert "heat-point" in first.content.decode()
    changed = REWARD.replace("1e-3", "2e-3").replace("(0.5, 0.1)", "(0.5, 0.9)")
    second = client.post("/learn/laboratory/", {**sent, "before": REWARD, "reward_code": changed}).content.decode()
    assert "Effect of the change" in second
    broken = client.post(
        "/learn/laboratory/", {**sent, "reward_code": "def reward_function(params):\n    return nothing\n"}
    )
    assert "nothing" in broken.content.decode() and "heat-point" not in broken.content.decode()

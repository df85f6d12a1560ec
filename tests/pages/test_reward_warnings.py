"""What Validate warns about on the page and over the API, and what the page of a slow training says."""

from __future__ import annotations

from django.utils import timezone

from tests.pages.conftest import World
from tests.pages.test_training import form_of
from tests.training.jobs import a_training
from training.models import JobState, TrainingJob

NEVER = "def reward_function(params):\n    return float(params['steps'] == 1)\n"


def test_validate_answers_warnings_beside_problems(world: World) -> None:
    client = world.client("alice")
    said = client.post("/train/validate/", {"reward_code": NEVER, "race_type": "time_trial"}).json()
    assert said["problems"] == []
    assert [(one["code"], one["line"]) for one in said["warnings"]] == [("reward_first_step", 2)]
    page = client.post("/train/new/", {**form_of(client, name="x"), "reward_code": NEVER, "do": "validate"})
    assert '<ul class="warnings"><li>' in page.content.decode()


def test_a_training_that_ended_before_its_first_update_says_how_slow_its_function_was(world: World) -> None:
    job = a_training(world.alice, world.track, timezone.now())
    now = timezone.now()
    ended = {"state": JobState.FINISHED, "ended_because": "time", "steps_done": 16, "reward_ms": 181.4, "ended_at": now}
    TrainingJob.objects.filter(pk=job.pk).update(**ended)
    client = world.client("alice")
    page = client.get(job.get_absolute_url())
    assert page.status_code == 200
    assert "Each call of the reward function took 181 ms" in page.content.decode()
    assert "181 ms" in client.get(f"/api/v1/trainings/{job.public_id}/").json()["ending"]

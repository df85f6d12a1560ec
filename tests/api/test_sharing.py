"""Sharing models through the API, and training from one that is shared."""

from __future__ import annotations

import io
import json
import zipfile
from datetime import timedelta

import pytest
from django.utils import timezone

from evaluation.garage.services import share_model
from evaluation.models import Network
from tests.factories import a_model, a_race, a_track
from tests.training.jobs import REWARD
from training.models import TrainingJob
from training.trainer.network import NetworkLayout

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/models/"


def at(model) -> str:
    return f"{ADDRESS}{model.public_id}/"


@pytest.fixture
def shared(alice):
    """Alice's, shared."""
    model = a_model(alice, name="Lightning")
    share_model(model=model, now=timezone.now())
    return model


def test_a_model_is_shared_and_unshared(alice, cast):
    model = a_model(alice)
    owner = cast["owner"]
    assert owner.get(at(model)).data["shared"] is False
    answer = owner.patch(at(model), {"shared": True})
    assert (answer.status_code, answer.data["shared"], answer.data["name"]) == (200, True, model.name)
    assert owner.patch(at(model), {"description": "Fast."}).data["shared"] is True, "what is not sent stays"
    seen = {role: client.get(at(model)).status_code for role, client in cast.items()}
    assert seen == {"owner": 200, "member": 200, "stranger": 200, "admin": 200, "anonymous": 401}
    assert cast["stranger"].get(at(model)).data["owner"] == "alice"
    assert owner.patch(at(model), {"shared": False}).data["shared"] is False
    assert cast["stranger"].get(at(model)).status_code == 404


@pytest.mark.parametrize("method", ["patch", "delete"])
def test_only_its_owner_changes_a_shared_model(shared, cast, method):
    for role in ("member", "stranger", "admin"):
        assert getattr(cast[role], method)(at(shared)).status_code == 404, role
    assert getattr(cast["anonymous"], method)(at(shared)).status_code == 401


@pytest.mark.parametrize("value", ["perhaps", [], {}, 7])
def test_a_value_that_is_not_boolean_is_refused(alice, cast, value):
    model = a_model(alice)
    answer = cast["owner"].patch(at(model), {"shared": value}, format="json")
    assert (answer.status_code, set(answer.data["fields"])) == (400, {"shared"})
    model.refresh_from_db()
    assert model.shared_at is None


def test_a_refused_rename_does_not_share_the_model(alice, cast):
    model, other = a_model(alice), a_model(alice)
    assert cast["owner"].patch(at(model), {"name": other.name, "shared": True}).status_code == 409
    model.refresh_from_db()
    assert model.shared_at is None


def test_the_garage_can_be_filtered_by_sharing(alice, shared, cast):
    kept = a_model(alice)
    names = {
        asked: {row["name"] for row in cast["owner"].get(ADDRESS, {"shared": asked}).data["results"]}
        for asked in ("true", "false")
    }
    assert names == {"true": {"Lightning"}, "false": {kept.name}}
    assert cast["owner"].get(ADDRESS).data["count"] == 2
    assert cast["owner"].get(ADDRESS, {"shared": "perhaps"}).status_code == 400
    assert cast["stranger"].get(ADDRESS, {"shared": "true"}).data["count"] == 0, "the garage is one's own"


def test_shared_models_are_listed_in_pages(alice, bob, shared, cast, django_assert_max_num_queries):
    later = a_model(bob, name="Thunder")
    share_model(model=later, now=timezone.now() + timedelta(hours=1))
    a_model(bob)
    with django_assert_max_num_queries(4):
        answer = cast["stranger"].get(f"{ADDRESS}shared/", {"page_size": 1})
    assert (answer.data["count"], answer.data["pages"]) == (2, 2)
    assert [(row["name"], row["owner"], row["shared"]) for row in answer.data["results"]] == [("Thunder", "bob", True)]
    of_alice = cast["stranger"].get(f"{ADDRESS}shared/", {"racer": "ALICE"}).data["results"]
    assert [row["name"] for row in of_alice] == ["Lightning"]
    assert cast["stranger"].get(f"{ADDRESS}shared/", {"racer": "nobody"}).data["count"] == 0
    assert cast["anonymous"].get(f"{ADDRESS}shared/").status_code == 401


def test_a_visible_model_can_be_downloaded_as_a_package(alice, shared, cast):
    answer = cast["stranger"].get(f"{at(shared)}package/")
    assert (answer.status_code, answer["Content-Type"]) == (200, "application/zip")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert json.loads(archive.read("model_metadata.json")) == shared.metadata
        assert archive.read("model.onnx")
    kept = a_model(alice)
    found = {role: client.get(f"{at(kept)}package/").status_code for role, client in cast.items()}
    assert found == {"owner": 200, "member": 404, "stranger": 404, "admin": 404, "anonymous": 401}


def test_a_shared_model_of_another_cannot_be_submitted(shared, cast):
    race = a_race(timezone.now())
    answer = cast["stranger"].post(f"/api/v1/races/{race.slug}/submissions/", {"model": shared.public_id})
    assert (answer.status_code, answer.data["code"]) == (403, "model_not_yours")


class TestTraining:
    @pytest.fixture(autouse=True)
    def _installed(self, trainings_taken_on, monkeypatch):
        monkeypatch.setattr("training.jobs.api.trainings.refusals", lambda *_: [])

    def begin(self, client, model):
        sent = {"name": "mine-now", "track": a_track().slug, "reward_code": REWARD, "clone_from": model.public_id}
        return client.post("/api/v1/trainings/", sent)

    def test_a_training_starts_from_a_shared_model(self, shared, cast, charlie):
        Network.objects.filter(pk=shared.network_id).update(parameters=NetworkLayout.of(shared.metadata).parameters)
        answer = self.begin(cast["stranger"], shared)
        assert answer.status_code == 201, answer.data
        assert answer.data["cloned_from"] == shared.public_id
        assert len(answer.data["action_space"]) == 3
        assert TrainingJob.objects.get().owner == charlie

    def test_a_training_from_an_unshared_model_is_refused(self, shared, cast):
        cast["owner"].patch(at(shared), {"shared": False})
        answer = self.begin(cast["stranger"], shared)
        assert (answer.status_code, answer.data["code"]) == (403, "clone_not_yours")

    def test_a_training_from_an_unknown_network_layout_is_refused(self, shared, cast):
        answer = self.begin(cast["stranger"], shared)
        assert (answer.status_code, answer.data["code"]) == (400, "clone_not_ours")

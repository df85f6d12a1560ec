"""Sharing a model and training from another's, on the pages."""

from __future__ import annotations

import io
import json
import zipfile
from datetime import timedelta

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from evaluation.garage.services import share_model, stop_sharing_model
from evaluation.models import TrainedModel
from races.entries.services.submissions import submit_model
from tests.factories import a_model, a_race, drive, finish, laps
from tests.pages.conftest import VIEWERS, World
from tests.pages.test_queries import FEW
from tests.pages.test_queries import queries as queries_of_page
from tests.training.jobs import a_training
from training.cloning.views import SHARED_PER_PAGE
from training.models import TrainingJob, Vehicle

pytestmark = pytest.mark.usefixtures("trainings_taken_on")
LIMIT = 12
BROWSE = "/models/shared/"


@pytest.fixture
def shared(world: World) -> TrainedModel:
    """Alice's Lightning, shared."""
    share_model(model=world.model, now=world.now)
    return world.model


def body(client, path: str) -> str:
    response = client.get(path)
    assert response.status_code == 200, path
    return response.content.decode()


def statuses(world: World, path: str) -> dict[str, int]:
    return {viewer: world.client(viewer).get(path).status_code for viewer in VIEWERS}


PARTS = ("", "sensors.png", "package.zip")


@pytest.mark.parametrize("part", PARTS)
def test_a_shared_model_is_open_to_members_until_unshared(world: World, part) -> None:
    path = f"/models/{world.model.public_id}/{part}"
    own = {"anonymous": 302, "newcomer": 404, "alice": 200, "bob": 404, "admin": 404}
    assert statuses(world, path) == own
    share_model(model=world.model, now=world.now)
    assert statuses(world, path) == {**dict.fromkeys(VIEWERS, 200), "anonymous": 302}
    stop_sharing_model(model=world.model)
    assert statuses(world, path) == own


@pytest.mark.parametrize("part", ["edit/", "delete/"])
def test_only_its_owner_changes_a_shared_model(world: World, shared: TrainedModel, part) -> None:
    path = f"/models/{shared.public_id}/{part}"
    assert statuses(world, path) == {"anonymous": 302, "newcomer": 404, "alice": 200, "bob": 404, "admin": 404}


def test_the_page_explains_sharing_and_shares_the_model(world: World) -> None:
    client, path = world.client("alice"), f"/models/{world.model.public_id}/"
    page = body(client, path)
    assert "This model is private." in page and "can also race a downloaded copy" in page
    answer = client.post(f"{path}share/", follow=True)
    world.model.refresh_from_db()
    assert world.model.shared_at is not None
    assert "Model shared" in answer.content.decode() and "Shared since" in answer.content.decode()
    assert '<span class="pill">shared</span>' in body(client, "/models/")
    answer = client.post(f"{path}share/", {"stop": "1"}, follow=True)
    world.model.refresh_from_db()
    assert world.model.shared_at is None
    assert "This model is private." in answer.content.decode()


def test_only_owners_share_a_model_and_only_admins_stop_it(world: World, shared: TrainedModel) -> None:
    path = f"/models/{shared.public_id}/share/"
    assert world.client("bob").get(path).status_code == 405
    for viewer in ("bob", "newcomer"):
        assert world.client(viewer).post(path, {"stop": "1"}).status_code == 404
        assert world.client(viewer).post(path).status_code == 404
    assert world.client("anonymous").post(path, {"stop": "1"}).status_code == 302
    shared.refresh_from_db()
    assert shared.shared_at == world.now
    admin = world.client("admin")
    assert "Stop sharing (as an admin)" in body(admin, f"/models/{shared.public_id}/")
    assert admin.post(path).status_code == 404, "an admin shares nobody's model"
    assert admin.post(path, {"stop": "1"})["Location"] == BROWSE
    shared.refresh_from_db()
    assert shared.shared_at is None


def test_a_downloaded_package_can_be_uploaded_again(world: World, shared: TrainedModel) -> None:
    response = world.client("bob").get(f"/models/{shared.public_id}/package.zip")
    assert response["Content-Disposition"] == 'attachment; filename="Lightning.zip"'
    with zipfile.ZipFile(io.BytesIO(response.content)) as archive:
        assert sorted(archive.namelist()) == ["model.onnx", "model_metadata.json"]
        assert json.loads(archive.read("model_metadata.json")) == shared.metadata


def test_others_cannot_race_a_shared_model_and_see_board_runs_only(world: World) -> None:
    car = world.finished.evaluation.model
    kept = world.other.evaluation  # of alice's in the same race, not the one that counts
    share_model(model=car, now=world.now)
    share_model(model=kept.model, now=world.now)
    page = body(world.client("bob"), f"/models/{car.public_id}/")
    assert world.finished.evaluation.public_id in page
    assert "Submit to a race" not in page and "Name and look" not in page
    assert 'href="/racers/alice/"' in page
    page = body(world.client("bob"), f"/models/{kept.model.public_id}/")
    assert kept.public_id not in page and "No visible board results yet" in page
    assert kept.public_id in body(world.client("alice"), f"/models/{kept.model.public_id}/")


def test_a_shared_model_of_another_cannot_be_submitted(world: World, shared: TrainedModel) -> None:
    client = world.client("bob")
    before = TrainedModel.objects.filter(owner=world.bob).count()
    client.post("/races/open-race/submit/", {"model": shared.public_id})
    assert not shared.evaluations.exists()
    assert TrainedModel.objects.filter(owner=world.bob).count() == before


def test_a_racers_page_lists_shared_models_to_members(world: World, shared: TrainedModel) -> None:
    link = f'href="/models/{shared.public_id}/"'
    assert link in body(world.client("bob"), "/racers/alice/")
    assert link not in body(world.client("anonymous"), "/racers/alice/")
    assert link not in body(world.client("bob"), "/racers/bob/")


class TestBrowsing:
    def test_browsing_needs_a_log_in(self, world: World) -> None:
        assert statuses(world, BROWSE) == {**dict.fromkeys(VIEWERS, 200), "anonymous": 302}

    def test_it_shows_the_best_lap_visible_to_the_visitor(self, world: World) -> None:
        car, kept = world.finished.evaluation.model, world.other.evaluation.model
        for model in (car, kept):
            share_model(model=model, now=world.now)
        page = body(world.client("bob"), BROWSE)
        assert "0:10.000" in page, "it stands on a board"
        assert "0:12.000" not in page, "alice's alone"
        assert "0:12.000" in body(world.client("alice"), BROWSE)

    def test_laps_by_other_rules_are_not_its_best(self, world: World) -> None:
        now, track = world.now, world.finished.evaluation.track
        car = drive(a_race(now, slug="fair", track=track), world.alice, laps(9_500, 9_400, 9_450), now).evaluation.model
        share_model(model=car, now=now)
        loose = a_race(now, slug="loose", track=track, off_track_penalty_ms=0)
        finish(submit_model(race=loose, racer=world.alice, model=car, now=now), laps(4_100, 4_100, 4_100), now)
        page = body(world.client("bob"), BROWSE)
        assert "0:09.400" in page and "0:04.100" not in page

    def test_it_shows_owner_and_network_and_links_the_wizard(self, world: World, shared: TrainedModel) -> None:
        from training.trainer.network import NetworkLayout

        type(shared.network).objects.filter(pk=shared.network_id).update(
            parameters=NetworkLayout.of(shared.metadata).parameters
        )
        page = body(world.client("bob"), BROWSE)
        for word in ("Lightning", 'href="/racers/alice/"', "front camera", "shallow", "3 actions"):
            assert word in page, word
        assert f"/train/new/?clone={shared.public_id}" in page
        wizard = body(world.client("bob"), f"/train/new/?clone={shared.public_id}")
        assert f'<option value="{shared.public_id}" selected>Lightning (alice)</option>' in wizard
        assert '<optgroup label="Shared models">' in wizard

    def test_it_offers_no_training_from_an_unknown_network_layout(self, world: World, shared: TrainedModel) -> None:
        page = body(world.client("bob"), BROWSE)
        assert f"?clone={shared.public_id}" not in page and "network of another build" in page

    def test_it_finds_models_by_name_and_racer(self, world: World, shared: TrainedModel) -> None:
        share_model(model=a_model(world.bob, name="Thunder"), now=world.now)
        client = world.client("newcomer")
        assert "Thunder" not in body(client, f"{BROWSE}?q=LIGHT") and "Lightning" in body(client, f"{BROWSE}?q=LIGHT")
        assert "Lightning" not in body(client, f"{BROWSE}?q=bob") and "Thunder" in body(client, f"{BROWSE}?q=bob")
        assert "No matching models or racers." in body(client, f"{BROWSE}?q=%00nothing%25")

    def test_it_is_paginated_at_a_constant_number_of_queries(self, world: World, shared: TrainedModel) -> None:
        def queries(path: str) -> int:
            with CaptureQueriesContext(connection) as captured:
                body(client, path)
            return sum(not query["sql"].startswith(("SAVEPOINT", "RELEASE", "BEGIN", "COMMIT")) for query in captured)

        client = world.client("bob")
        before = queries(BROWSE)
        for number in range(SHARED_PER_PAGE + 2):
            model = a_model(world.alice, name=f"Shared {number}")
            share_model(model=model, now=world.now + timedelta(seconds=number + 1))
        race = a_race(world.now)
        share_model(
            model=drive(race, world.alice, laps(9_000, 9_000, 9_000), world.now).evaluation.model, now=world.now
        )
        assert queries(BROWSE) <= before + 1 <= LIMIT + 1, "a second page is counted"
        assert "Page 1 of 2" in body(client, BROWSE)
        assert "Lightning" in body(client, f"{BROWSE}?page=2")
        for path in ("/racers/alice/", f"/models/{shared.public_id}/"):
            assert len(queries_of_page(client, path)) <= FEW

    def test_it_says_when_nothing_is_shared(self, world: World) -> None:
        TrainedModel.objects.filter(owner__is_house=True).update(deleted_at=world.now)
        assert "No shared models yet." in body(world.client("bob"), BROWSE)


class TestClone:
    @pytest.fixture
    def clone(self, world: World, shared: TrainedModel) -> TrainedModel:
        """Bob's, trained from alice's."""
        job = a_training(world.bob, world.track, world.now, name="from-alice")
        model = a_model(world.bob, name="Offspring")
        TrainingJob.objects.filter(pk=job.pk).update(cloned_from=shared, best_model=model)
        return model

    def test_a_clone_links_its_origin_while_that_is_shared(self, world: World, shared, clone) -> None:
        path = f"/models/{clone.public_id}/"
        page = body(world.client("bob"), path)
        assert f'<a href="/models/{shared.public_id}/">Lightning</a>' in page and "(alice)" in page
        stop_sharing_model(model=shared)
        page = body(world.client("bob"), path)
        assert "Lightning" in page and f'href="/models/{shared.public_id}/"' not in page

    def test_a_clone_does_not_reveal_an_unshared_origin(self, world: World, shared, clone) -> None:
        stop_sharing_model(model=shared)
        share_model(model=clone, now=world.now)
        page = body(world.client("newcomer"), f"/models/{clone.public_id}/")
        assert "Lightning" not in page and "a model that is not shared" in page
        assert f"/models/{shared.public_id}/" in body(world.client("alice"), f"/models/{clone.public_id}/")


class TestVehicleForClone:
    def test_a_fitting_vehicle_is_proposed_and_leads_back(self, world: World, shared: TrainedModel) -> None:
        """The original car sees with one camera, and so does bob's; this model sees with two."""
        Vehicle.objects.create(owner=world.bob, name="Deep", neural_network="DEEP_CONVOLUTIONAL_NETWORK_DEEP")
        TrainedModel.objects.filter(pk=shared.pk).update(metadata=shared.metadata | {"sensor": ["STEREO_CAMERAS"]})
        client = world.client("bob")
        wizard = body(client, f"/train/new/?clone={shared.public_id}")
        assert "None of your vehicles fits" in wizard
        link = f"/vehicles/new/?clone={shared.public_id}"
        assert f'href="{link}"' in wizard
        assert 'value="Lightning"' in body(client, link)
        sent = {"name": "Like it", "camera": "STEREO_CAMERAS", "lidar": "", "shell": "paddock"}
        sent |= {"neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW", "colour": "#ffffff"}
        answer = client.post(link, sent)
        assert answer["Location"] == f"/train/new/?clone={shared.public_id}"
        assert "None of your vehicles fits" not in body(client, answer["Location"])

    def test_no_vehicle_is_proposed_after_a_hidden_model(self, world: World) -> None:
        page = body(world.client("bob"), f"/vehicles/new/?clone={world.model.public_id}")
        assert "Lightning" not in page

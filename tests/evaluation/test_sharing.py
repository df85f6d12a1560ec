"""A model that its owner shares: who may see it, until when, and what stays when that ends."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import IntegrityError

from accounts.models import Racer
from evaluation.garage.services import delete_model, purge_garages, share_model, stop_sharing_model
from evaluation.models import Network, TrainedModel
from evaluation.selectors import (
    can_see_model,
    can_stop_sharing,
    can_use_model,
    is_shared,
    models_of,
    shared_models,
    visible_models,
)
from paddock.errors import UserFault
from tests.rows import model_row

pytestmark = pytest.mark.django_db


@pytest.fixture
def cast(alice, bob):
    """Alice owns, Bob is another racer, Sam an admin; one is not logged in."""
    sam = Racer.objects.create_superuser("sam", "sam@example.org", "correct horse battery")
    return {"owner": alice, "other": bob, "admin": sam, "anonymous": AnonymousUser()}


def who_sees(model: TrainedModel, cast: dict) -> set[str]:
    """The roles that see the model, by the predicate and by the queryset, which must agree."""
    seeing = {role for role, racer in cast.items() if can_see_model(racer, model)}
    assert seeing == {role for role, racer in cast.items() if model in visible_models(racer)}
    listed = {role for role, racer in cast.items() if model in shared_models(racer)}
    assert listed == ({"owner", "other", "admin"} if is_shared(model) else set())
    return seeing


def fresh(model: TrainedModel) -> TrainedModel:
    return TrainedModel.objects.select_related("owner").get(pk=model.pk)


def test_only_a_shared_model_is_visible_to_others(alice, cast, now):
    model = model_row(alice)
    assert who_sees(model, cast) == {"owner"}
    share_model(model=model, now=now)
    assert model.shared_at == now
    assert who_sees(fresh(model), cast) == {"owner", "other", "admin"}
    stop_sharing_model(model=model)
    assert who_sees(fresh(model), cast) == {"owner"}


def test_only_its_owner_races_and_changes_a_shared_model(alice, cast, now):
    model = model_row(alice)
    share_model(model=model, now=now)
    assert {role for role, racer in cast.items() if can_use_model(racer, model)} == {"owner"}
    assert not any(model in models_of(racer) for role, racer in cast.items() if role != "owner")


def test_its_owner_and_admins_may_end_the_sharing(alice, cast, now):
    model = model_row(alice)
    assert not any(can_stop_sharing(racer, model) for racer in cast.values())
    share_model(model=model, now=now)
    assert {role for role, racer in cast.items() if can_stop_sharing(racer, model)} == {"owner", "admin"}


def test_sharing_twice_keeps_the_first_timestamp(alice, now):
    model = model_row(alice)
    share_model(model=model, now=now)
    share_model(model=model, now=now + timedelta(days=1))
    assert model.shared_at == now


def test_deletion_ends_sharing_for_good(alice, cast, now):
    model = model_row(alice)
    share_model(model=model, now=now)
    delete_model(model=model, now=now)
    assert model.shared_at is None
    assert who_sees(fresh(model), cast) == set()
    with pytest.raises(UserFault) as refused:
        share_model(model=model, now=now)
    assert refused.value.code == "model_deleted_not_shared"
    assert fresh(model).shared_at is None


def test_the_database_refuses_a_shared_deleted_model(alice, now):
    model = model_row(alice)
    with pytest.raises(IntegrityError):
        TrainedModel.objects.filter(pk=model.pk).update(deleted_at=now, shared_at=now)


def test_a_deactivated_racer_shares_nothing(alice, cast, now):
    model = model_row(alice)
    share_model(model=model, now=now)
    Racer.objects.filter(pk=alice.pk).update(is_active=False)
    model = fresh(model)
    assert not is_shared(model)
    assert who_sees(model, {role: racer for role, racer in cast.items() if role != "owner"}) == set()


def test_house_cars_are_visible_to_everybody(alice, bob, cast):
    model = model_row(bob)
    Racer.objects.filter(pk=bob.pk).update(is_house=True)
    model = fresh(model)
    assert is_shared(model)
    assert model in shared_models(alice) and can_see_model(alice, model)
    assert not can_use_model(alice, model)


def test_the_most_recently_shared_comes_first(alice, bob, now):
    early, late = model_row(alice, "Early", b"1"), model_row(alice, "Late", b"2")
    share_model(model=late, now=now)
    share_model(model=early, now=now - timedelta(hours=1))
    assert [model.name for model in shared_models(bob)] == ["Late", "Early"]


def test_deleting_an_uncloned_shared_model_frees_its_network(alice, now):
    model = model_row(alice, at=now - timedelta(days=9))
    Network.objects.update(created_at=now - timedelta(days=9))
    share_model(model=model, now=now - timedelta(days=8))
    delete_model(model=model, now=now - timedelta(days=7))
    assert purge_garages(now=now) == 1
    assert not TrainedModel.objects.exists()

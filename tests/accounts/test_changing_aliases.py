"""A racer's alias changes seldom, keeps its history, and never looks like somebody else's."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.exceptions import ValidationError
from django.urls import reverse

from accounts.models import ClassLearner, Classroom, PastAlias, Racer, RacerGroup
from accounts.profile.aliases import change_alias
from accounts.signing_in.reserved_aliases import is_taken
from paddock.errors import UserFault
from tests.clients import logged_in
from tests.factories import a_race, a_racer, drive, laps


def test_the_board_shows_the_new_alias_and_the_old_page_leads_to_the_new_one(db, now, client, wakes):
    race, racer = a_race(now), a_racer("oldname")
    drive(race, racer, laps(10_000, 10_000, 10_000), now)
    change_alias(racer=racer, alias="NewName", now=now)
    page = client.get(race.get_absolute_url()).content.decode()
    assert "NewName" in page and "oldname" not in page
    assert client.get(reverse("racer", args=["OldName"])).url == reverse("racer", args=["NewName"])
    assert list(PastAlias.objects.values_list("racer", "alias", "changed_at")) == [(racer.pk, "oldname", now)]


def test_the_old_address_is_the_next_owners_once_somebody_has_the_alias(db, now, client):
    change_alias(racer=a_racer("oldname"), alias="newname", now=now)
    Racer.objects.create_user("oldname", "other@example.org")
    assert client.get(reverse("racer", args=["oldname"])).status_code == 200


def test_the_former_alias_waits_for_its_owner_alone(db, now, settings):
    racer, other = a_racer("first"), a_racer("other")
    change_alias(racer=racer, alias="second", now=now)
    assert refused(other, "f1rst", now) == "alias_taken"
    later = now + timedelta(days=settings.ALIAS_CHANGE_DAYS)
    assert change_alias(racer=racer, alias="first", now=later).alias == "first"
    assert not is_taken("first", later, racer)
    free = now + timedelta(days=settings.ALIAS_RESERVED_DAYS)
    assert refused(other, "second", later) == "alias_taken"
    assert change_alias(racer=other, alias="second", now=free + timedelta(days=settings.ALIAS_CHANGE_DAYS)).alias


@pytest.mark.parametrize(
    ("alias", "code"),
    [
        ("mine", "alias_same"),
        ("Alice", "alias_taken"),
        ("a1ice", "alias_taken"),
        ("al-ice", "alias_taken"),
        ("steward", "alias_reserved"),
        ("deleted-racer-4", "alias_reserved"),
    ],
)
def test_impersonation_is_refused(alias, code, db, now):
    a_racer("alice")
    assert refused(a_racer("mine"), alias, now) == code
    assert Racer.objects.filter(alias="mine").exists() and not PastAlias.objects.exists()


def test_only_letter_case_or_look_of_ones_own_may_change(db, now):
    assert change_alias(racer=a_racer("mine"), alias="Mine", now=now).alias == "Mine"


@pytest.mark.parametrize("alias", ["a b", "ä", "x", "x" * 65])
def test_the_form_of_an_alias_is_checked(alias, db, now):
    with pytest.raises(ValidationError):
        change_alias(racer=a_racer("mine"), alias=alias, now=now)


def test_it_changes_once_in_some_days(db, now, settings):
    racer = a_racer("one")
    change_alias(racer=racer, alias="two", now=now)
    almost = now + timedelta(days=settings.ALIAS_CHANGE_DAYS, seconds=-1)
    assert refused(racer, "three", almost) == "alias_too_soon"
    assert change_alias(racer=racer, alias="three", now=almost + timedelta(seconds=1)).alias == "three"


def test_a_class_account_keeps_its_alias(db, now):
    racer = a_racer("swift-otter")
    room = Classroom.objects.create(group=RacerGroup.objects.create(slug="c", name="C", made_at=now), made_at=now)
    ClassLearner.objects.create(racer=racer, classroom=room, real_name="R")
    assert refused(racer, "other", now) == "alias_of_class"


def test_the_page_changes_it_and_lists_the_past_ones(db):
    racer = a_racer("before")
    client = logged_in(racer)
    assert client.post(reverse("alias"), {"alias": "admin"}).status_code == 200
    assert client.post(reverse("alias"), {"alias": "after"}).url == reverse("alias")
    page = client.get(reverse("alias")).content.decode()
    assert "before" in page and "after" in page and '<form method="post" class="fields"' not in page


def test_admins_see_the_past_ones(db, now):
    admin, racer = a_racer(is_staff=True, is_superuser=True), a_racer("before")
    change_alias(racer=racer, alias="after", now=now)
    assert "before" in logged_in(admin).get(f"/admin/accounts/racer/{racer.pk}/change/").content.decode()


def refused(racer: Racer, alias: str, now) -> str:
    with pytest.raises(UserFault) as fault:
        change_alias(racer=racer, alias=alias, now=now)
    return fault.value.code

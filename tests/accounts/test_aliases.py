"""Aliases that seem to speak for the site."""

from __future__ import annotations

import pytest

from accounts.models import Racer
from accounts.signing_in.reserved_aliases import is_reserved


@pytest.mark.parametrize(
    "alias",
    [
        *("admin", "Admin", "ADMIN", "adm1n", "4dmin", "a-d-m-i-n", "adrnin", "Admin_", "admin-jane", "the_admin"),
        *("staff", "5taff", "paddock", "Padd0ck", "paddock-team", "official", "0fficial", "official_results"),
        *("house", "house-fast", "H0use", "steward", "stewards", "api", "AP1", "me", "new", "no-reply", "null"),
    ],
)
def test_reserved_aliases_cannot_sign_up(alias):
    assert is_reserved(alias)


@pytest.mark.parametrize("alias", ["ayrton", "Speedy_1", "housecat", "administer", "badminton", "apis", "newt"])
def test_aliases_that_merely_contain_a_reserved_one_are_free(alias):
    assert not is_reserved(alias)


@pytest.mark.django_db
def test_the_form_shows_the_error_beside_the_field(client):
    said = {"email": "a@example.org", "password1": "a long enough passphrase", "password2": "a long enough passphrase"}
    page = client.post("/accounts/signup/", said | {"username": "0fficial"})
    assert page.context["form"].errors["username"]
    assert not Racer.objects.exists()


@pytest.mark.django_db
def test_an_operator_may_create_a_reserved_alias():
    assert Racer.objects.create_superuser("admin", "admin@example.org", None).alias == "admin"

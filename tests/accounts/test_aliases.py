"""Aliases that seem to speak for the site."""

from __future__ import annotations

import pytest

from accounts.aliases import is_reserved
from accounts.models import Racer


@pytest.mark.parametrize(
    "alias",
    [
        *("admin", "Admin", "ADMIN", "adm1n", "4dmin", "a-d-m-i-n", "adrnin", "Admin_", "admin-jane", "the_admin"),
        *("staff", "5taff", "paddock", "Padd0ck", "paddock-team", "official", "0fficial", "official_results"),
        *("house", "house-fast", "H0use", "steward", "stewards", "api", "AP1", "me", "new", "no-reply", "null"),
    ],
)
def test_nobody_signs_up_as_the_site(alias):
    assert is_reserved(alias)


@pytest.mark.parametrize("alias", ["ayrton", "Speedy_1", "housecat", "administer", "badminton", "apis", "newt"])
def test_names_that_only_contain_one_of_them_are_free(alias):
    assert not is_reserved(alias)


@pytest.mark.django_db
def test_the_form_says_so_beside_the_field(client):
    said = {"email": "a@example.org", "password1": "a long enough passphrase", "password2": "a long enough passphrase"}
    page = client.post("/accounts/signup/", said | {"username": "0fficial"})
    assert page.context["form"].errors["username"]
    assert not Racer.objects.exists()


@pytest.mark.django_db
def test_who_runs_the_site_may_make_them():
    assert Racer.objects.create_superuser("admin", "admin@example.org", None).alias == "admin"

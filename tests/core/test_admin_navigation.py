"""The side bar of the admin site, which admins with the same permissions share."""

import re

import pytest
from django.contrib.auth.models import Permission
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext

from tests.factories import a_racer

pytestmark = pytest.mark.django_db(transaction=True)


def side_bar(client: Client, path: str = "/admin/tracks/track/") -> tuple[set[str], list[str]]:
    """The lists that it links, and those marked as the page's."""
    html = client.get(path).content.decode()
    bar = re.search(r'<nav class="sticky" id="nav-sidebar".*?</nav>', html, re.DOTALL)[0]
    links = re.findall(r'<a href="(/admin/\w+/\w+/)"( aria-current="page")?>', bar)
    return {link for link, _mark in links}, [link for link, mark in links if mark]


def test_admins_see_what_their_permissions_allow():
    chief, marshal = a_racer("chief", is_staff=True, is_superuser=True), a_racer("marshal", is_staff=True)
    marshal.user_permissions.add(Permission.objects.get(codename="view_track"))
    chiefs, marshals = Client(), Client()
    chiefs.force_login(chief)
    marshals.force_login(marshal)
    for _ in range(2):
        assert side_bar(chiefs)[0] > {"/admin/tracks/track/", "/admin/races/race/", "/admin/accounts/racer/"}
        assert side_bar(marshals) == ({"/admin/tracks/track/"}, ["/admin/tracks/track/"])
        for mine in ("/admin/tracks/track/", "/admin/races/race/"):
            assert side_bar(chiefs, mine)[1] == [mine]
    marshal.user_permissions.add(Permission.objects.get(codename="view_race"))
    assert side_bar(marshals, "/admin/races/race/") == (
        {"/admin/tracks/track/", "/admin/races/race/"},
        ["/admin/races/race/"],
    )


def test_all_permissions_are_read_in_one_query():
    chief, client = a_racer("chief", is_staff=True, is_superuser=True), Client()
    client.force_login(chief)
    with CaptureQueriesContext(connection) as captured:
        html = client.get(f"/admin/accounts/racer/{chief.pk}/change/").content.decode()
    assert html.count("Can view") > 50
    assert len(captured) < 20

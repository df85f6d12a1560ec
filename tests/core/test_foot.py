"""The foot of every page."""

from __future__ import annotations

import pytest
from django.template import Context, Template

PAGE = (
    "{% load site %}{% operators_links as links %}"
    "{% for label, address in links %}[{{ label }} {{ address }}]{% endfor %}"
)


def foot() -> str:
    return Template(PAGE).render(Context())


def test_a_site_without_links_shows_none():
    assert foot() == ""


def test_the_operators_links_stand_in_their_order(settings):
    settings.FOOT_LINKS = {
        "chat": 'https://chat.example.org/?room=a&b="c',
        "tips": "https://example.org/tips",
        "forum": "",
        "terms": "https://example.org/terms",
        "privacy": "",
    }
    assert (
        foot()
        == "[Chat https://chat.example.org/?room=a&amp;b=&quot;c][Tips https://example.org/tips][Terms of use https://example.org/terms]"
    )


@pytest.mark.django_db
def test_every_page_carries_them(settings, client):
    settings.FOOT_LINKS = {"privacy": "https://example.org/privacy"}
    assert '<a href="https://example.org/privacy" rel="noopener">Privacy</a>' in client.get("/about/").content.decode()

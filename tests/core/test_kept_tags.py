"""Texts and addresses that templates keep: as Django's own tags render them, in each language and below each prefix."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from django.template import Context, Engine
from django.urls import NoReverseMatch, set_script_prefix
from django.utils.translation import override

KEPT = Engine.get_default()
DJANGOS = Engine()
DJANGOS_I18N = Engine(libraries={"i18n": "django.templatetags.i18n"})
TEXTS = (
    '{% translate "Board" %}',
    '{% trans "Board" noop %}',
    '{% translate "Live" context "event" %}',
    '{% translate "Log out" as words %}[{{ words }}]',
    '{% translate "log out"|upper %}',
    "{% translate word %}",
    "{% blocktranslate trimmed %}\n  Board{% endblocktranslate %}",
    "{% blocktranslate %}100 % of <{{ word }}>{% endblocktranslate %}",
    "{% blocktranslate count count=n %}{{ count }} racer{% plural %}{{ count }} racers{% endblocktranslate %}",
    '{% translate "100 % <b>" %}',
)


@pytest.mark.parametrize("text", TEXTS)
def test_a_text_is_translated_as_by_django(text: str) -> None:
    kept, known = (engine.from_string("{% load i18n %}" + text) for engine in (KEPT, DJANGOS_I18N))
    for language in ("en", "ko", "en", "ko"):
        for word, number in (("Board", 1), ("<Rules>", 2)):
            with override(language):
                values = {"word": word, "n": number}
                assert kept.render(Context(values)) == known.render(Context(values))


@pytest.fixture
def below() -> Iterator[Callable[[str], None]]:
    yield set_script_prefix
    set_script_prefix("/")


@pytest.mark.parametrize(
    "text",
    [
        "{% url 'races' %}",
        "{% url 'race' slug %}",
        "{% url 'race' slug=slug %}",
        "{% url name slug %}",
        "{% url 'race' slug as at %}[{{ at }}]",
        "{% url 'none' as at %}[{{ at }}]",
        "{% url 'admin:index' %}",
        "{% autoescape off %}{% url 'race' slug %}{% endautoescape %}",
    ],
)
def test_an_address_is_as_by_django(below: Callable[[str], None], text: str) -> None:
    kept, known = (engine.from_string(text) for engine in (KEPT, DJANGOS))
    for prefix in ("/", "/paddock/", "/"):
        below(prefix)
        for slug, name in (("oval", "race"), ("kuei", "race_rules")):
            values = {"slug": slug, "name": name}
            assert kept.render(Context(values)) == known.render(Context(values))


def test_an_address_that_does_not_exist_fails_each_time() -> None:
    for _ in range(2):
        with pytest.raises(NoReverseMatch):
            KEPT.from_string("{% url 'race' %}").render(Context())


def test_an_address_of_another_url_configuration_is_that_ones(settings: Any) -> None:
    template = KEPT.from_string("{% url 'races' %}")
    assert template.render(Context()) == "/races/"
    settings.ROOT_URLCONF = "tests.core.other_urls"
    assert template.render(Context()) == "/elsewhere/"

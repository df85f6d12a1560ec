"""Names in right-to-left scripts are isolated wherever a template shows one."""

from __future__ import annotations

import re

import pytest
from django.template import Context, Template
from django.utils.safestring import mark_safe

from core.templatetags.formats import bdi
from tests.core.test_template_rooms import TEMPLATES

# A text that somebody wrote, shown without the filter
NAMES = re.compile(
    r"\{\{\s*(?:[\w.]*\b(?:race|model|track|season|team|group|vehicle|guest|sensor|round|one|each|row|car)\.name"
    r"|[\w.]+\|named|[\w.]*(?:shown_name|guest_name|real_name|removal_reason|cancel_reason|\.prize|\.sponsor|\.driver_names))\s*\}\}"
)
PLAIN = re.compile(r"<(title|option|textarea|script)\b.*?</\1>|<[a-z!/][^<>]*>", re.S)
TITLES = re.compile(r"\{% block (?:title|description|head) %\}.*?\{% endblock", re.S)


@pytest.mark.parametrize("name", ["שלום", "مرحبا", "Team שלום 5", "٣"])
def test_a_name_with_right_to_left_letters_is_isolated(name: str) -> None:
    assert bdi(name) == f"<bdi>{name}</bdi>"
    assert Template("{% load formats %}{{ name|bdi }} 5").render(Context({"name": name})) == f"<bdi>{name}</bdi> 5"


@pytest.mark.parametrize("name", ["Monaco", "한국어", "<b>", "", None, mark_safe("<b>שלום</b>")])
def test_other_texts_stay_as_they_are(name: object) -> None:
    assert bdi(name) is name


def test_markup_in_a_name_is_text() -> None:
    assert bdi('<i title="א">') == "<bdi>&lt;i title=&quot;א&quot;&gt;</bdi>"


def test_a_sentence_isolates_the_name_in_it() -> None:
    words = (
        "{% load i18n formats %}{% blocktranslate with race=race|bdi %}Entries of {{ race }} (5){% endblocktranslate %}"
    )
    assert Template(words).render(Context({"race": "מרוץ"})) == "Entries of <bdi>מרוץ</bdi> (5)"


def test_every_template_isolates_names() -> None:
    plain = []
    for name, path in TEMPLATES.items():
        if path.suffix == ".html":
            text = TITLES.sub("", path.read_text())
            text = re.sub(r"\{%.*?%\}", "", text, flags=re.S)
            plain += [f"{name}: {found}" for found in NAMES.findall(PLAIN.sub("", text))]
    assert plain == []

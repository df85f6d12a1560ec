"""The guides in Korean: block by block, what is not translated in English."""

from __future__ import annotations

import re
from collections import Counter

import pytest
from django.test import Client
from django.utils.translation import gettext, override

from config.guides import pages as guides
from config.guides.pages import GUIDES, blocks_of, guide_named, page_of, search
from config.guides.translation import in_language, needs_words
from tests.docs.korean_guides import CATALOGUE, translations
from tests.pages.test_guides import Links

every_guide = pytest.mark.parametrize("guide", GUIDES, ids=lambda guide: guide.slug)
pytestmark = pytest.mark.django_db


@pytest.fixture
def written(settings, tmp_path):
    """The guide for racers with this text instead of the site's own."""

    def write(text: str) -> guides.Guide:
        (tmp_path / "docs").mkdir()
        (tmp_path / "docs" / "racers.md").write_text(text)
        settings.BASE_DIR = tmp_path
        return guide_named("racers")

    return write


@every_guide
def test_links_and_anchors_are_the_same_in_both_languages(guide):
    korean, english = (Links(str(page_of(guide, language).html)) for language in ("ko", "en"))
    assert korean.ids == english.ids
    assert Counter(korean.links) == Counter(english.links)


@every_guide
def test_no_mark_of_markdown_is_left_in_the_text(guide):
    shown = re.sub(r"<(pre|code)\b.*?</\1>", "", str(page_of(guide, "ko").html), flags=re.S)
    assert not re.search(r"\*\*|`|\]\(", shown)


def test_a_translation_keeps_the_code_and_the_links_of_its_block():
    def kept(text: str) -> tuple[set[str], Counter[str]]:
        return set(re.findall(r"`[^`]+`", text)), Counter(re.findall(r"\]\(([^)]*)\)", text))

    assert not [block for block, said in translations(CATALOGUE).items() if kept(block) != kept(said)]


def test_korean_has_one_word_for_each_thing_in_the_guides_too():
    for said in translations(CATALOGUE).values():
        assert "경주" not in said
        assert "학습" not in re.sub("강화 학습|기계 학습|지도 학습|학습률", "", said), said


def test_what_is_not_translated_is_english_and_says_so(written):
    guide = written("# For racers\n\nNobody has ever put this into other words.\n")
    page = page_of(guide, "ko")
    assert (page.language, page.untranslated, page.title) == ("ko", 1, "레이서용")
    assert '<p><span lang="en">Nobody has ever put this into other words.</span></p>' in page.html
    told = Client(headers={"accept-language": "ko"}).get("/guides/racers/").content.decode()
    assert "아직 영어로" in told and '<article class="guide" lang="ko">' in told
    assert page_of(guide, "en").untranslated == 0


def test_a_guide_without_any_translation_is_in_english(written):
    page = page_of(written("# Zebras\n\nThey cross the road.\n"), "ko")
    assert (page.language, page.title, page.sections[0].language) == ("en", "Zebras", "en")


def test_line_breaks_of_the_file_do_not_matter(written):
    page = page_of(written("# For\n\n## For\nracers\n\n- For\n  racers\n"), "ko")
    assert page.html.count("레이서용") == 1


def test_reasons_and_rules_are_said_as_the_site_says_them():
    page = str(page_of(guide_named("reference"), "ko").html)
    damaged = "The archive is damaged or incomplete. Download or pack it again, then upload it."
    with override("ko"):
        assert f"<td>{gettext(damaged)}</td>" in page
    assert damaged not in page and "<em>limit</em>" in page
    assert "맞대결: 봇 수." in page and "<td>1~20</td>" in page
    assert "The archive is damaged or incomplete. Download or pack it again, then upload it." not in translations(
        CATALOGUE
    )


def test_single_words_of_the_site_are_not_taken_for_those_of_a_guide():
    with override("ko"):
        assert gettext("Shell") == "외장"
    assert in_language("Shell", "ko") is None


def test_figures_code_units_and_names_of_tracks_need_no_words():
    same = ("3", "0.5 m", "`code` `more`", "64 MB", "120 × 160 × 1", "2022 re:Invent Championship", "[1, 2]", "")
    assert not [block for block in same if needs_words(block)]
    assert blocks_of("# A car\n\n<!-- no -->\n| `x` | 3 m | yes |\n|---|---|---|\n| 4 | ccw | no limit |\n") == [
        (1, "A car"),
        (4, "yes"),
        (6, "no limit"),
    ]


def test_a_search_in_korean_finds_sections_by_korean_and_by_english_words():
    by_korean, by_english = search("심사위원용", "ko"), search("for stewards", "ko")
    for found in (by_korean, by_english):
        assert (found[0].guide.slug, found[0].section.anchor) == ("organisers", "for-stewards")
        assert (found[0].section.title, found[0].section.language) == ("심사위원용", "ko")
    page = Client(headers={"accept-language": "ko"}).get("/guides/?q=심사위원용").content.decode()
    assert '<a class="strong" href="/guides/organisers/#for-stewards" lang="ko">심사위원용</a>' in page
    assert search("심사위원용", "en") == []

"""The Korean catalogue of the guides is whole, and is what the site reads."""

from __future__ import annotations

import shutil

import pytest

from config.guides.pages import GUIDES
from tests.docs import korean_guides

COMMAND = ".venv/bin/python -m tests.docs.korean_guides"
needs_gettext = pytest.mark.skipif(not shutil.which("msgmerge"), reason="gettext's tools are not installed")
pytestmark = needs_gettext


@pytest.mark.parametrize("guide", GUIDES, ids=lambda guide: guide.slug)
def test_a_guide_is_in_korean(guide):
    lacking = korean_guides.lacking(guide)
    assert not lacking, f"run {COMMAND} and write the Korean into {korean_guides.CATALOGUE}"


def test_the_compiled_catalogue_matches_its_source(tmp_path):
    korean_guides.compile_catalogue(tmp_path / "guides.mo")
    compiled = korean_guides.CATALOGUE.with_suffix(".mo").read_bytes()
    assert (tmp_path / "guides.mo").read_bytes() == compiled, f"run {COMMAND}"


@pytest.fixture
def catalogue(tmp_path, monkeypatch):
    """A catalogue of its own with one translation, and what the guides say meanwhile."""
    path = tmp_path / "guides.po"
    path.write_text(f'{korean_guides._HEADER}\nmsgid "The car drives three laps."\nmsgstr "차가 세 랩을 달립니다."\n')
    monkeypatch.setattr(korean_guides, "CATALOGUE", path)

    def collected(*said: str):
        monkeypatch.setattr(korean_guides, "blocks", lambda: ((GUIDES[0], 1, block) for block in said))
        korean_guides.collect()
        return path.read_text()

    return collected


def test_a_changed_sentence_keeps_its_old_translation_for_translators_only(catalogue):
    text = catalogue("The car drives four laps.")
    assert '#, fuzzy\n#| msgid "The car drives three laps."\nmsgid "The car drives four laps."' in text
    assert "차가 세 랩을" in text
    assert korean_guides.translations(korean_guides.CATALOGUE) == {}


def test_what_no_guide_says_any_more_leaves_the_catalogue(catalogue):
    assert "랩을" not in catalogue("Zebras cross here, and nothing else does: they have stripes.")


def test_a_new_sentence_waits_for_its_translation_and_others_stay(catalogue):
    text = catalogue("The car drives three laps.", 'A "new" one with \\ in it, quite unlike the other.')
    assert 'msgid "The car drives three laps."\nmsgstr "차가 세 랩을 달립니다."' in text
    assert 'msgid "A \\"new\\" one with \\\\ in it, quite unlike the other."\nmsgstr ""' in text


def test_a_block_that_two_branches_brought_is_kept_once_with_its_translation(catalogue):
    path = korean_guides.CATALOGUE
    path.write_text(f'{path.read_text()}\nmsgid "New here, and quite unlike it."\nmsgstr ""\n')
    path.write_text(f'{path.read_text()}\nmsgid "New here, and quite unlike it."\nmsgstr "새것"\n')
    collected = catalogue("The car drives three laps.", "New here, and quite unlike it.")
    assert collected.count("New here") == 1
    assert korean_guides.translations(path)["New here, and quite unlike it."] == "새것"

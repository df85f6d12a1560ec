"""The guides of docs/ as pages of the site."""

from __future__ import annotations

import re
from functools import cache
from html.parser import HTMLParser

import pytest
from django.test import Client

from config.guides import pages as guides
from config.guides.pages import GUIDES, Guide, anchor_of, page_of, search
from tests.docs.pages import DOCS, anchors

every_guide = pytest.mark.parametrize("guide", GUIDES, ids=lambda guide: guide.slug)
pytestmark = pytest.mark.django_db


class Links(HTMLParser):
    """What a page's article links to, its ids, and its elements."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: list[str] = []
        self.tags: set[str] = set()
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        told = dict(attrs)
        self.tags.add(tag)
        if tag == "a":
            self.links.append(told.get("href", ""))
        if "id" in told:
            self.ids.append(told["id"])


@cache
def article(slug: str) -> Links:
    return Links(str(page_of(guides.guide_named(slug), "en").html))


@pytest.fixture
def written(settings, tmp_path):
    """A guide with this text instead of the site's own."""

    def write(text: str, slug: str = "racers") -> Guide:
        folder = tmp_path / "docs"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{slug}.md").write_text(text)
        settings.BASE_DIR = tmp_path
        return guides.guide_named(slug)

    return write


@every_guide
def test_every_link_of_a_guide_leads_to_a_place_that_is_there(guide):
    own = article(guide.slug)
    assert len(own.ids) == len(set(own.ids))
    for link in own.links:
        address, _mark, anchor = link.partition("#")
        if "://" in address:
            continue
        match = re.fullmatch(r"(?:/guides/(\w+)/)?", address)
        assert match, link
        assert not anchor or anchor in article(match[1] or guide.slug).ids, link


@every_guide
def test_headings_have_the_addresses_that_code_hosts_give_them(guide):
    assert set(article(guide.slug).ids) >= anchors((DOCS / f"{guide.slug}.md").read_text())


@every_guide
def test_no_guide_has_a_style_of_its_own(guide):
    html = str(page_of(guide, "en").html)
    assert not re.search(r"<[^>]* style=", html)
    assert guide.slug != "tracks" or '<td class="num">5.71 m</td>' in html


@every_guide
def test_a_guides_page_opens_for_everybody(guide):
    answer = Client().get(f"/guides/{guide.slug}/")
    assert answer.status_code == 200
    assert "This guide is in English" not in answer.content.decode()


def test_html_in_a_guide_is_text_and_no_script_address_is_a_link(written):
    text = (
        "# Guide\n\n<script>alert(1)</script>\n\n<b onclick=x>b</b> [a](javascript:alert(1)) [b](data:text/html,x) "
        "[c](../secret.py) ![d](d.png)\n\n<!-- note -->\n## A & <i>B</i>\n"
    )
    page = page_of(written(text), "en")
    made = Links(str(page.html))
    assert made.tags <= {"h1", "h2", "p", "em", "a"} and made.links == []
    assert "&lt;script&gt;" in page.html and "note" not in page.html
    assert [section.anchor for section in page.sections] == ["guide", "a--ibi"]


def test_headings_of_one_name_have_addresses_of_their_own(written):
    page = page_of(written("# A\n\n## Use\n\n## Use\n\n## `Use`!\n"), "en")
    assert [section.anchor for section in page.sections] == ["a", "use", "use-1", "use-2"]
    assert anchor_of("What's new: 2 things_here") == "whats-new-2-things_here"


def test_a_changed_guide_is_read_anew(written):
    import os

    guide = written("# Old\n")
    assert page_of(guide, "en").title == "Old"
    written("# New\n")
    path = guides.Path(guides.settings.BASE_DIR) / "docs" / "racers.md"
    os.utime(path, ns=(1, 1))
    assert page_of(guide, "en").title == "New"


def test_a_search_finds_sections_those_first_whose_headings_say_it():
    found = search("Open TRACKS", "en")
    assert (found[0].guide.slug, found[0].section.anchor) == ("simulator", "open-tracks")
    assert len(found) > 1
    assert all("open" in (one.section.title + one.section.text).lower() for one in found)
    assert search("zebra crossing", "en") == [] == search("  ", "en")


def test_the_search_page_links_to_the_section():
    page = Client().get("/guides/?q=open+tracks").content.decode()
    assert 'href="/guides/simulator/#open-tracks"' in page
    assert "No results. Try fewer" in Client().get("/guides/?q=%3Cscript%3E%00zebra").content.decode()


def test_a_guide_that_is_not_there_is_not_found(written):
    written("# Racers\n")  # and no other
    assert Client().get("/guides/api/").status_code == 404
    assert Client().get("/guides/passwords/").status_code == 404


OLD_ANCHORS_FOR_RACERS = """
a-cars-report a-video-of-a-run account at-home bring-a-car-that-was-trained-elsewhere commands comparing-runs
conversion-of-a-tensorflow-graph domain-randomisation downloads duels every-reason-code follow-racers for-racers
from-sign-up-to-the-first-result from-the-checkout how-a-training-learns hyperparameters live-events live-races
model_metadatajson no-spoilers notices on-the-track other-systems-and-other-pythons own-runs paddocks-own-faults
policies-of-stable-baselines3 practise-on-your-own-machine programs prove-a-result race races read-a-result
recorded-drives reports reward-functions runs-of-your-own several-cars-in-a-race several-tracks share-a-model
stacked-frames submit-on-every-push take-a-model-elsewhere teams terms-of-a-race texts the-board the-command
the-cup-of-the-day the-league the-network the-onnx-contract the-package the-same-hash-at-home the-stream track-files
train-a-car trainings upload vehicles videos what-a-reward-function-may-import what-is-on-the-track
what-may-be-uploaded while-it-trains-and-after write-a-reward-function you-against-another-racer your-account
your-cars-speed
""".split()  # noqa: SIM905


def test_every_old_address_of_the_guide_for_racers_still_leads_to_its_section():
    page = Links(Client().get("/guides/racers/").content.decode())
    assert len(page.ids) == len(set(page.ids)) and set(OLD_ANCHORS_FOR_RACERS) <= set(page.ids)
    for link in page.links:
        if match := re.fullmatch(r"/guides/(\w+)/#(.+)", link):
            assert match[2] in article(match[1]).ids, link


def test_the_old_address_of_the_rules_redirects_to_their_table():
    answer = Client().get("/guides/rules/")
    assert (answer.status_code, answer["Location"]) == (301, "/guides/reference/#the-rules-of-a-race")

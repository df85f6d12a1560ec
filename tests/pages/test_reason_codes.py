"""Pages explain a refusal in a sentence. Its stable code is for programs: an attribute, never text."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from django.conf import settings
from django.utils import timezone

from paddock.errors.reasons import REASONS
from races.models import Division, RaceKind
from tests.factories import a_model, a_race

from .conftest import World

# Operators filter failures by code; the page of the API explains codes.
FOR_OPERATORS = {"config/operations/failed_runs.html", "config/operations/workers.html", "config/api/reference.html"}
PRINTED = re.compile(r"\{\{\s*[\w.]*\breason_code\s*\}\}|\{\{\s*(?:\w+\.)*(?:fault|error)\.code\s*\}\}")


class _Text(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []

    def handle_data(self, data: str) -> None:
        self.said.append(data)


def words_of(html: str) -> set[str]:
    """Every word that a page shows."""
    reader = _Text()
    reader.feed(html)
    return set(re.findall(r"\w+", " ".join(reader.said)))


def codes_shown(html: str) -> set[str]:
    return {word for word in words_of(html) if "_" in word and word in REASONS}


def test_no_template_prints_a_reason_code() -> None:
    root = Path(settings.BASE_DIR) / "templates"
    for path in root.rglob("*.html"):
        if str(path.relative_to(root)) in FOR_OPERATORS:
            continue
        outside_tags = re.sub(r"<(?:[^<>\"]|\"[^\"]*\")*>", "\n", path.read_text())
        assert not PRINTED.search(outside_tags), path


@pytest.mark.parametrize("name", ["failed", "ours"])
def test_a_failed_run_is_explained_without_its_code(world: World, name: str) -> None:
    run, owner = world.evaluation(name), getattr(world, name).entry.racer
    client = world.client(owner.alias)
    for address in (run.get_absolute_url(), "/", "/races/fault-race/", "/races/fault-race/runs/"):
        html = client.get(address).content.decode()
        assert not codes_shown(html), address
    assert f'data-code="{run.reason_code}"' in client.get(run.get_absolute_url()).content.decode()


def test_a_refused_submission_is_explained_without_its_code(world: World) -> None:
    now = timezone.now()
    a_race(now, slug="pro-race", name="Pro race", kind=RaceKind.LEAGUE, division=Division.PRO)
    model = a_model(world.newcomer)
    for slug, code in (("pro-race", "race_pro_only"), ("old-race", "race_closed")):
        answer = world.client("newcomer").post(f"/races/{slug}/submit/", {"model": model.public_id}, follow=True)
        html = answer.content.decode()
        assert f'data-code="{code}"' in html and not codes_shown(html)


def test_a_refused_form_is_explained_without_codes(world: World) -> None:
    answer = world.client("alice").post("/races/new/", {"name": "Again", "slug": "open-race"})
    assert answer.status_code == 422 and not codes_shown(answer.content.decode())

"""Which site and whose token: kept for nobody else's eyes, and sent to nobody else's site."""

from __future__ import annotations

import stat

import pytest

from paddock.cli.settings import Settings, address, split_page
from paddock.errors import UserFault

HOME = "https://race.example.org"


def kept(**tokens: str) -> Settings:
    settings = Settings.read()
    settings.usual, settings.tokens = HOME, tokens
    settings.write()
    return Settings.read()


def test_the_file_can_be_read_by_its_owner_alone(config):
    assert kept(**{HOME: "secret"}).tokens == {HOME: "secret"}
    assert stat.S_IMODE((config / "sites.json").stat().st_mode) == 0o600
    assert stat.S_IMODE(config.stat().st_mode) == 0o700
    assert [path.name for path in config.iterdir()] == ["sites.json"]


def test_a_token_goes_to_no_other_site():
    settings = kept(**{HOME: "secret"})
    assert settings.token_for(HOME) == "secret"
    assert settings.token_for("https://elsewhere.example.org") == settings.token_for("http://race.example.org") == ""


def test_a_token_of_the_environment_is_for_the_site_of_the_environment():
    settings = kept(**{HOME: "kept"})
    both = {"PADDOCK_SITE": f"{HOME}/", "PADDOCK_TOKEN": "given"}
    assert settings.token_for(HOME, both) == "given"
    assert settings.token_for("https://elsewhere.example.org", both) == ""
    assert settings.token_for(HOME, {"PADDOCK_TOKEN": "given"}) == "kept"


@pytest.mark.parametrize("text", ["", "[]", '{"usual": 1}', "not JSON", '{"usual": "", "tokens": []}'])
def test_a_file_that_is_not_ours_is_refused_and_stays(config, text):
    config.mkdir()
    (config / "sites.json").write_text(text)
    with pytest.raises(UserFault) as caught:
        Settings.read()
    assert caught.value.code == "home_file_unreadable"
    assert (config / "sites.json").read_text() == text


@pytest.mark.parametrize(
    ("given", "form"),
    [
        ("https://race.example.org/", HOME),
        ("https://RACE.example.org/api/v1/", HOME),
        ("http://127.0.0.1:8000", "http://127.0.0.1:8000"),
        ("https://example.org/paddock/", "https://example.org/paddock"),
        ("http://[::1]:8000/", "http://[::1]:8000"),
    ],
)
def test_an_address_has_one_form(given, form):
    assert address(given) == form


@pytest.mark.parametrize(
    "given", ["race.example.org", "ftp://race.example.org", "https://", "", "https://me:pw@host/", "http://host:port/"]
)
def test_what_is_no_address_is_refused(given):
    with pytest.raises(UserFault) as caught:
        address(given)
    assert caught.value.code == "site_address"


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ("2026-11-open", ("", "2026-11-open")),
        (f"{HOME}/races/2026-11-open/", (HOME, "2026-11-open")),
        (f"{HOME}/races/2026-11-open/runs/?page=2", (HOME, "2026-11-open")),
        (f"{HOME}/api/v1/races/2026-11-open/board/", (HOME, "2026-11-open")),
        (f"{HOME}/races/", (HOME, "")),
        (f"{HOME}/tracks/oval/", (f"{HOME}/tracks/oval", "")),
        ("a/b", ("", "")),
    ],
)
def test_a_race_is_named_by_its_page_or_its_slug(given, found):
    assert split_page(given, "races") == found

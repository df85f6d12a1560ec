"""Sign-up and log-in call the alias an alias, and a field with a pattern names it."""

from __future__ import annotations

import re

import pytest
from django.test import Client

from tests.factories import a_racer

pytestmark = pytest.mark.django_db

SIGN_UP = {"email": "new@example.org", "password1": "lane-9-apex", "password2": "lane-9-apex"}


@pytest.fixture(autouse=True)
def _alone(wakes: list[dict]) -> None:
    a_racer("kay")


def errors_of(answer) -> str:
    found = re.findall(r'<ul class="errors".*?</ul>|<p data-code.*?</p>', answer.content.decode(), re.S)
    return re.sub(r"<[^>]*>", " ", " ".join(found))


@pytest.mark.parametrize("alias", ["kay", "KAY", "admin", "Paddock", "a", "a b", "*", "a" * 65, ""])
@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_refused_alias_is_called_an_alias(alias: str, language: str) -> None:
    client = Client(headers={"accept-language": language})
    said = errors_of(client.post("/accounts/signup/", SIGN_UP | {"username": alias}))
    assert said and not re.search("user ?name|사용자 ?이름|사용자명", said, re.I)
    if alias.lower() in ("kay", "admin", "paddock"):
        assert ("alias" if language == "en" else "별명") in said.lower()


@pytest.mark.parametrize("login", ["kay", "nobody", "kay@example.org"])
def test_a_wrong_password_speaks_of_alias_or_address(login: str) -> None:
    said = errors_of(Client().post("/accounts/login/", {"login": login, "password": "wrong"}))
    assert said and not re.search("user ?name", said, re.I)


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_new_racer_reads_where_the_link_is(language: str, settings, tmp_path) -> None:
    settings.EMAIL_BACKEND, settings.EMAIL_FILE_PATH = "core.mail.FolderBackend", tmp_path
    client = Client(headers={"accept-language": language})
    new = {"username": "newcomer", "email": f"{language}@example.org"}  # an address gets one mail in minutes
    text = client.post("/accounts/signup/", SIGN_UP | new, follow=True).content.decode()
    assert len(list(tmp_path.iterdir())) == 1
    assert "was sent to" not in text and "보냈습니다" not in text
    assert ("in the folder mail of the data folder" if language == "en" else "데이터 폴더의 mail 폴더") in text


def test_the_alias_pattern_is_named_where_a_browser_shows_it() -> None:
    html = Client().get("/accounts/signup/").content.decode()
    field = re.search(r'<input[^>]*name="username"[^>]*>', html)[0]
    assert "pattern=" in field and 'title="2 to 64 English letters, digits, hyphens and underscores."' in field

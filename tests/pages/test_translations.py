"""Both languages are whole: nothing is forgotten in the templates or in the catalogue."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tests.docs.word_counts import ROOMS
from tests.pages.conftest import World
from tests.pages.test_pages import address
from tests.shared import CHECKOUT

CATALOGUE = CHECKOUT / "locale" / "ko" / "LC_MESSAGES" / "django.po"
TEMPLATES = CHECKOUT / "templates"
# What is the same in every language.
SAME = {
    "paddock",
    "api",
    "csv",
    "pdf",
    "json",
    "atom",
    "icalendar",
    "onnx",
    "tensorflow",
    "sha-",
    "model_metadata.json",
    "english",
    "openapi",
    "stable-baselines",
}
PLACEHOLDER = re.compile(r"%\(\w+\)[sd]|%[sd]")


def messages(path: Path = CATALOGUE) -> list[tuple[str, str, str, str]]:
    """(flags, msgid, plural, msgstr) of every entry of a catalogue but its header."""
    found = []
    for block in path.read_text().split("\n\n"):
        parts: dict[str, str] = {}
        key = ""
        for line in block.splitlines():
            if match := re.match(r'(msgctxt|msgid_plural|msgid|msgstr)(?:\[\d\])? "(.*)"$', line):
                key = match[1]
                parts[key] = parts.get(key, "") + match[2].replace('\\"', '"')
            elif key and (match := re.match(r'"(.*)"$', line)):
                parts[key] += match[1].replace('\\"', '"')
        flags = "".join(line for line in block.splitlines() if line.startswith("#,"))
        if parts.get("msgid"):
            found.append((flags, parts["msgid"], parts.get("msgid_plural", ""), parts.get("msgstr", "")))
    return found


def test_every_message_is_translated_and_none_is_fuzzy() -> None:
    entries = messages()
    assert len(entries) > 500
    assert not [msgid for _, msgid, _, text in entries if not text]
    assert not [msgid for flags, msgid, _, _ in entries if "fuzzy" in flags]


def test_korean_has_one_word_for_each_thing() -> None:
    """A race is 레이스, to train is 훈련 and to learn 배우기; 학습 stays where the field's own terms have it."""
    templates = CHECKOUT / "training" / "templates"
    pages = [path.read_text() for folder in ("lessons", "guides") for path in (templates / folder / "ko").iterdir()]
    for text in [*(text for _, _, _, text in messages()), *pages]:
        assert "경주" not in text
        assert "학습" not in re.sub("강화 학습|기계 학습|지도 학습|학습률", "", text), text


def test_every_translation_keeps_the_placeholders() -> None:
    wrong = [
        msgid
        for _, msgid, plural, text in messages()
        if set(PLACEHOLDER.findall(plural or msgid)) != set(PLACEHOLDER.findall(text))
    ]
    assert not wrong


def test_translations_keep_the_markup_of_their_message() -> None:
    def tags(text: str) -> list[str]:
        return sorted(re.findall(r"</?\w+", text))

    assert not [msgid for _, msgid, _, text in messages() if "</" in msgid and tags(msgid) != tags(text)]


@pytest.mark.skipif(not shutil.which("msgfmt"), reason="gettext's tools are not installed")
def test_the_compiled_catalogue_matches_its_source(tmp_path: Path) -> None:
    compiled = tmp_path / "django.mo"
    subprocess.run(["msgfmt", "--check", "-o", compiled, CATALOGUE], check=True, capture_output=True)
    assert compiled.read_bytes() == CATALOGUE.with_suffix(".mo").read_bytes(), "run manage.py compilemessages -l ko"


# The place of the message among the arguments of each function that translates.
TRANSLATES = {"_": 0, "ngettext": 0, "ngettext_lazy": 0, "pgettext": 1, "pgettext_lazy": 1}
TRANSLATES |= dict.fromkeys(("gettext", "gettext_lazy", "gettext_noop"), 0)


def translated_in(path: Path) -> list[str]:
    """The messages that a module translates, also inside of f-strings, which xgettext does not read."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in TRANSLATES:
            message = node.args[TRANSLATES[node.func.id]]
            found += [message.value] if isinstance(message, ast.Constant) else []
    return found


def test_messages_in_f_strings_are_in_the_catalogue() -> None:
    known = {msgid.replace("\\n", "\n") for _, msgid, _, _ in messages()}
    modules = [path for room in ROOMS for path in (CHECKOUT / room).rglob("*.py") if path.parent.name != "migrations"]
    needed = {message for path in modules for message in translated_in(path)}
    assert len(needed) > 500
    assert not sorted(needed - known - {""})


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("xgettext"), reason="gettext's tools are not installed")
def test_the_catalogue_contains_every_message_of_the_code(tmp_path: Path) -> None:
    known = {msgid for _, msgid, _, _ in messages()}
    for name in (*ROOMS, "templates"):
        shutil.copytree(CHECKOUT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "locale").mkdir()
    program = "import django; from django.conf import settings; settings.configure(); django.setup(); " + (
        "from django.core.management import call_command; "
        "call_command('makemessages', locale=['ko'], keep_pot=True, verbosity=0)"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True, capture_output=True)
    needed = {msgid for _, msgid, _, _ in messages(tmp_path / "locale" / "ko" / "LC_MESSAGES" / "django.po")}
    assert len(needed) > 500
    assert not sorted(needed - known), "run manage.py makemessages -l ko and translate"


class Words(HTMLParser):
    """The words of a template that no translation tag wraps."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.quiet = 0

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.quiet += tag in ("code", "pre", "script", "option", "svg")
        for name, value in attrs:
            if name in ("title", "aria-label", "placeholder", "alt") and value:
                self._note(value)

    def handle_endtag(self, tag: str) -> None:
        self.quiet -= tag in ("code", "pre", "script", "option", "svg")

    def handle_data(self, data: str) -> None:
        if self.quiet <= 0:
            self._note(data)

    def _note(self, text: str) -> None:
        words = re.findall(r"[A-Za-z][A-Za-z_.-]{2,}", text)
        self.found += [word for word in words if word.lower() not in SAME]


def test_no_template_shows_untranslated_words() -> None:
    forgotten = {}
    for path in TEMPLATES.rglob("*.html"):
        if path.parent.name == "elements":  # no words in them: tags put together from pieces
            continue
        text = path.read_text()
        text = re.sub(r"{%\s*comment.*?endcomment\s*%}|{#.*?#}", " ", text, flags=re.S)
        text = re.sub(r"{%\s*blocktrans(?:late)?\b.*?{%\s*endblocktrans(?:late)?\s*%}", " ", text, flags=re.S)
        text = re.sub(r"{% block (?:main|body)_class %}.*?{% endblock %}", " ", text)
        text = re.sub(r"{%.*?%}|{{.*?}}", " ", text, flags=re.S)
        words = Words()
        words.feed(text)
        if words.found:
            forgotten[str(path.relative_to(TEMPLATES))] = words.found
    assert not forgotten


def test_korean_pages_have_no_english_sentences(world: World) -> None:
    english = re.compile(r">[^<]*\b(the|your|you|is|of|and|has|with)\b[^<]*<", re.I)
    client = world.client("alice")
    client.cookies["django_language"] = "ko"
    for path in (
        "/",
        "/about/",
        "/races/",
        "/races/open-race/",
        "/races/open-race/rules/",
        "/races/open-race/runs/",
        "/races/open-race/edit/",
        "/races/new/",
        "/models/",
        "/models/upload/",
        "/models/{model}/",
        "/evaluations/{finished}/",
        "/evaluations/{failed}/",
        "/tracks/",
        "/tracks/oval/",
        "/tracks/import/",
        "/settings/",
        "/settings/tokens/",
        "/settings/notices/",
        "/settings/webhooks/",
        "/notices/",
        "/seasons/",
        "/hall-of-fame/",
        "/racers/alice/",
        "/accounts/password/change/",
        "/accounts/email/",
    ):
        html = client.get(address(world, path)).content.decode()
        body = re.sub(r"<(script|pre|code)\b.*?</\1>", "", html, flags=re.S)
        assert not english.search(body), (path, english.search(body)[0][:80])

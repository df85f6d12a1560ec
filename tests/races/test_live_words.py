"""The log of a live event is read in words."""

from __future__ import annotations

import re
from pathlib import Path

from races.services import live
from races.templatetags.live import ACTS, act

WRITTEN = re.compile(r'acting\(\s*event, "(\w+)"|action="(\w+)"|_to\(event, slot, [\w.]+, "(\w+)"')


def test_everything_that_is_done_has_words():
    sources = "".join(file.read_text() for file in Path(live.__file__).parent.glob("*.py"))
    done = {next(filter(None, found)) for found in WRITTEN.findall(sources)}
    assert {"plan", "launch", "undo", "release"} <= done
    assert done == ACTS.keys()


def test_what_has_no_words_is_said_as_it_is():
    assert (act("launch"), act("something")) == ("launched", "something")

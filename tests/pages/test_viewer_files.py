"""The viewer's scripts: what a page loads for them, and what lies beside the vendored ones."""

import gzip
import json
import re

from django.conf import settings

from evaluation.appearance.looks import Shell

LIMIT = 350_000  # bytes, compressed
VENDORED = ("three.module.min.js", "three.core.min.js")


def test_the_viewer_is_small_enough():
    static = settings.BASE_DIR / "static"
    files = [*(static / "vendor" / name for name in VENDORED), *sorted((static / "viewer").glob("*.js*"))]
    files += sorted((static / "vendor").glob("uplot*.js"))
    assert len(files) > len(VENDORED) + 5
    assert sum(len(gzip.compress(path.read_bytes(), 9, mtime=0)) for path in files) < LIMIT


def test_three_has_its_licence_and_its_version():
    vendor = settings.BASE_DIR / "static" / "vendor"
    assert "MIT License" in (vendor / "three.LICENSE.txt").read_text()
    assert 'const t="180"' in (vendor / "three.core.min.js").read_text()


def test_each_shell_has_a_body_from_both_sides():
    drawings = json.loads((settings.BASE_DIR / "static" / "viewer" / "shells.json").read_text())
    assert set(drawings) == set(Shell.values)
    assert all(drawing["side"]["body"] and drawing["above"]["body"] for drawing in drawings.values())


def test_no_module_leads_back_to_itself():
    """Such modules have no hashed names: each would need the other's."""
    static = settings.BASE_DIR / "static"
    modules = {path: path.read_text() for path in static.rglob("*.js") if "vendor" not in path.parts}
    named = re.compile(r"(?:from|import\()\s*\"(\.{1,2}/[^\"]+)\"")
    ways = {
        path: {other for name in named.findall(text) if (other := (path.parent / name).resolve()) in modules}
        for path, text in modules.items()
    }
    assert sum(map(len, ways.values())) > 20
    for path in ways:
        seen, ahead = set(), list(ways[path])
        while ahead:
            seen.add(one := ahead.pop())
            ahead += ways[one] - seen
        assert path not in seen, path.name

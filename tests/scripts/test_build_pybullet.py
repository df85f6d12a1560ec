"""``scripts/build_pybullet.py``: the cache of built wheels, what stops a build before it begins, and its progress.

A tree of three small files is in the place of PyBullet; the real one is built by hand, for minutes."""

from __future__ import annotations

import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scripts import build_pybullet
from tests.shared import CHECKOUT

TAG = f"cp{sys.version_info[0]}{sys.version_info[1]}"
NAME = f"pybullet-{build_pybullet.version()}-{TAG}-{TAG}-linux_{platform.machine()}.whl"
EMPTY = b"PK\x05\x06" + bytes(18)  # a zip archive of nothing
SETUP = """
from setuptools import Extension, setup
setup(name="pybullet", version="1", ext_modules=[
    Extension("one", ["a.cpp", "b.cpp"]), Extension("two", ["b.cpp", "c.cpp"])])
"""


needs_compiler = pytest.mark.skipif(not shutil.which("g++"), reason="g++ is not installed")


@pytest.fixture
def folders(tmp_path, monkeypatch):
    monkeypatch.setattr(build_pybullet, "CACHE", tmp_path / "cache")
    monkeypatch.setattr(build_pybullet, "DIST", tmp_path / "dist")
    monkeypatch.setattr(build_pybullet, "is_published", lambda: False)
    for folder in ("cache", "dist"):
        (tmp_path / folder).mkdir()
    return tmp_path


@pytest.fixture
def tree(tmp_path):
    """The source of a package of two extensions, which share a file."""
    tree = tmp_path / "tree"
    tree.mkdir()
    (tree / "setup.py").write_text(SETUP)
    for name in "abc":
        (tree / f"{name}.cpp").write_text(f"int {name}() {{ return 1; }}\n")
    return tree


def test_what_is_built_is_the_locked_source():
    assert re.match(
        rf"pybullet=={re.escape(build_pybullet.version())} \\\n    --hash=", build_pybullet.locked("pybullet")
    )
    assert "hash" not in build_pybullet.locked("pybullet").splitlines()[0]
    assert build_pybullet.locked("setuptools").startswith("setuptools==")
    assert "pybullet" not in build_pybullet.locked("setuptools")


@pytest.mark.parametrize("folder", ["cache", "dist"])
def test_a_built_wheel_is_found(folders, folder):
    assert build_pybullet.find() is None
    (folders / folder / NAME).write_bytes(EMPTY)
    assert build_pybullet.find() == build_pybullet.provide() == folders / folder / NAME


@pytest.mark.parametrize(
    "other",
    [
        NAME.replace(build_pybullet.version(), "3.2.6"),
        NAME.replace(TAG, "cp39"),
        NAME.replace(f"-{TAG}-linux", f"-{TAG}t-linux"),
        NAME.replace(platform.machine(), "riscv64"),
        f".{NAME}",
    ],
)
def test_a_wheel_of_another_version_python_or_machine_is_not_taken(folders, other):
    (folders / "cache" / other).write_bytes(EMPTY)
    assert build_pybullet.find() is None


def test_a_damaged_wheel_is_not_taken(folders):
    (folders / "cache" / NAME).write_bytes(EMPTY[:-3])
    assert build_pybullet.find() is None


@needs_compiler
def test_the_wheel_is_compiled_and_every_file_counts(folders, tree, capsys, monkeypatch):
    monkeypatch.setattr(build_pybullet, "EVERY_S", 0.05)
    made = folders / "made"
    build_pybullet._compile_tree(sys.executable, tree, made)
    assert len(list(made.glob("*.whl"))) == 1
    first, *progress, last = capsys.readouterr().out.splitlines()
    assert "once for all checkouts: 3 files, about " in first and " minutes on " in first
    assert progress and all(re.match(r"  [0-3] of 3 files \(\d+ %\)", line) for line in progress)
    assert re.fullmatch(r"  compiled in [\d.]+ min", last)


@needs_compiler
def test_a_compiler_error_is_shown_with_its_words(folders, tree):
    (tree / "b.cpp").write_text("int b() { return nothing; }\n")
    with pytest.raises(build_pybullet.BuildError, match=r"does not compile for Python(.|\n)*nothing"):
        build_pybullet._compile_tree(sys.executable, tree, folders / "made")


def test_it_stops_at_once_without_a_compiler_and_headers(folders, monkeypatch):
    monkeypatch.setenv("CXX", "/nowhere/g++")
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setattr(build_pybullet, "_install_compiler", lambda: None)
    with pytest.raises(build_pybullet.BuildError, match=r"cannot be compiled: install a C\+\+ compiler.*Python 3\.11$"):
        build_pybullet.provide()
    assert list((folders / "cache").iterdir()) == []


def test_a_user_without_rights_gets_the_command_for_the_compiler(folders, monkeypatch, capfd):
    (folders / "id").write_text("#!/bin/sh\necho 1000\n")
    (folders / "apt-get").write_text("#!/bin/sh\nexit 1\n")
    for program in ("id", "apt-get"):
        (folders / program).chmod(0o755)
    monkeypatch.setattr(build_pybullet, "_compiles", lambda: False)
    monkeypatch.setattr(sys, "base_prefix", "/usr")
    monkeypatch.setenv("PATH", f"{folders}")
    with pytest.raises(SystemExit):
        build_pybullet.check()
    assert f"sudo apt-get install -y g++ python{build_pybullet.VERSION}-dev\n" in capfd.readouterr().err


def test_it_stops_at_once_without_virtual_environments(folders, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(build_pybullet.BuildError, match=rf"apt-get install -y python{build_pybullet.VERSION}-venv$"):
        build_pybullet.provide()


def test_it_stops_at_once_where_the_disk_is_too_small(folders, monkeypatch):
    monkeypatch.setattr(build_pybullet, "_compiles", lambda: True)
    monkeypatch.setattr(build_pybullet, "FREE_MB", 10**12)
    with pytest.raises(build_pybullet.BuildError, match=r"MB of disk and .*/cache has .* XDG_CACHE_HOME"):
        build_pybullet.provide()


@pytest.mark.slow
def test_it_stops_at_once_without_a_network(folders, monkeypatch, capsys):
    monkeypatch.setattr(build_pybullet, "_compiles", lambda: True)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    monkeypatch.setattr(sys, "argv", ["build_pybullet.py", "--build"])
    assert build_pybullet.main() == 1
    (sentence,) = capsys.readouterr().err.splitlines()
    assert "setuptools, which its build needs, could not be downloaded: connect to pip's index, " in sentence
    assert [path.suffix for path in (folders / "cache").iterdir()] == [".lock"]


SLOW = """
import os, sys, time
from pathlib import Path
sys.path.insert(0, {checkout!r})
from scripts import build_pybullet
build_pybullet.CACHE, build_pybullet.DIST = Path({folder!r}, "cache"), Path({folder!r}, "dist")
build_pybullet.check = lambda: None
def compile(place):
    (place / "half.whl").write_bytes({empty!r})
    print("building", flush=True)
    while not Path({folder!r}, "go").exists():
        time.sleep(0.02)
    return (place / "half.whl").replace(build_pybullet.CACHE / {name!r})
build_pybullet._compile = compile
print(build_pybullet.provide().name, flush=True)
"""


def start(folder: Path) -> subprocess.Popen[str]:
    """Another checkout that builds until the file ``go`` exists."""
    script = SLOW.format(checkout=str(CHECKOUT), folder=str(folder), name=NAME, empty=EMPTY)
    building = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert building.stdout is not None
    return building


def line_of(building: subprocess.Popen[str]) -> str:
    assert building.stdout is not None
    return building.stdout.readline().strip()


def test_two_checkouts_at_once_build_one_wheel(folders):
    first = start(folders)
    assert line_of(first) == "building"
    second = start(folders)
    assert line_of(second) == f"Waiting for another build of PyBullet {build_pybullet.version()}"
    (folders / "go").touch()
    assert line_of(first) == line_of(second) == NAME
    assert first.wait() == second.wait() == 0
    assert (folders / "cache" / NAME).read_bytes() == EMPTY


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_a_build_that_is_cut_off_leaves_no_wheel_and_the_next_one_succeeds(folders, how):
    first = start(folders)
    assert line_of(first) == "building"
    first.send_signal(how)
    assert first.wait(30) != 0
    assert build_pybullet.find() is None
    left = [path for path in (folders / "cache").iterdir() if path.suffix != ".lock"]
    assert bool(left) is (how == signal.SIGKILL), "what a killed program leaves is deleted by the next build"
    (folders / "go").touch()
    second = start(folders)
    assert [line_of(second), line_of(second)] == ["building", NAME]
    assert sorted(path.suffix for path in (folders / "cache").iterdir()) == [".lock", ".whl"]


@needs_compiler
def test_a_terminated_build_ends_its_compilers(folders, tree):
    (tree / "setup.py").write_text(
        f"{SETUP}\nimport pathlib, os, sys, time\nif 'bdist_wheel' in sys.argv:\n"
        f"    pathlib.Path({str(folders / 'pid')!r}).write_text(str(os.getpid()))\n    time.sleep(60)\n"
    )
    script = (
        f"import sys; sys.path.insert(0, {str(CHECKOUT)!r})\n"
        "from pathlib import Path; from scripts import build_pybullet as b\n"
        f"with b._workplace(Path({str(folders / 'place')!r})) as place:\n"
        f"    b._compile_tree(sys.executable, Path({str(tree)!r}), place / 'made')\n"
    )
    building = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.DEVNULL)
    pid = folders / "pid"
    while not (pid.exists() and pid.read_text()):
        assert building.poll() is None
        time.sleep(0.02)
    building.terminate()
    assert building.wait(30) == 143
    assert not Path(f"/proc/{pid.read_text()}").exists()
    assert not (folders / "place").exists()


def test_nothing_is_installed_where_the_index_has_a_wheel_or_it_is_installed(folders, monkeypatch):
    monkeypatch.setattr(build_pybullet, "provide", lambda: pytest.fail("no wheel is needed"))
    build_pybullet.install()
    monkeypatch.setattr(build_pybullet, "_installed", lambda: "")
    monkeypatch.setattr(build_pybullet, "is_published", lambda: True)
    build_pybullet.install()


def test_a_wheel_that_does_not_load_is_built_anew(folders, monkeypatch, capsys):
    (folders / "cache" / NAME).write_bytes(EMPTY)
    monkeypatch.setattr(build_pybullet, "_installed", lambda: "3.2.6")
    ran = []

    def run(*command: str) -> None:
        ran.append(command[-2:])
        if build_pybullet._TRY in command and len(ran) < 3:
            raise build_pybullet.BuildError("failed:\nGLIBC_2.99 not found")

    def provide() -> Path:
        if not (wheel := folders / "cache" / NAME).exists():
            wheel.write_bytes(EMPTY + b"new")
        return wheel

    monkeypatch.setattr(build_pybullet, "_run", run)
    monkeypatch.setattr(build_pybullet, "provide", provide)
    build_pybullet.install()
    assert "does not load here and is built anew: GLIBC_2.99 not found\n" in capsys.readouterr().out
    assert provide().read_bytes() == EMPTY + b"new"
    assert ran[2] == ("--yes", "pybullet") and ran[3][1] == str(provide())


def test_the_wheel_goes_beside_the_package_of_racers(folders, monkeypatch, capsys):
    (folders / "cache" / NAME).write_bytes(EMPTY)
    monkeypatch.setattr(sys, "argv", ["build_pybullet.py", str(folders / "dist")])
    assert build_pybullet.main() == 0
    assert (folders / "dist" / NAME).read_bytes() == EMPTY
    assert capsys.readouterr().out.startswith(f"{folders / 'dist' / NAME}  ")
    monkeypatch.setattr(sys, "argv", ["build_pybullet.py", "--state"])
    assert build_pybullet.main() == 0
    assert capsys.readouterr().out == "built\n"


def test_the_wheel_of_the_index_goes_there_by_its_locked_hash(folders, monkeypatch, capsys):
    """pip itself is a stub here: the tests have no network."""
    ran: list[tuple[str, ...]] = []

    def run(*command: str) -> None:
        ran.append(command)
        if "download" in command:
            Path(command[command.index("--dest") + 1], NAME).write_text("published")

    monkeypatch.setattr(build_pybullet, "_run", run)
    monkeypatch.setattr(build_pybullet, "is_published", lambda: True)
    monkeypatch.setattr(build_pybullet, "provide", lambda: pytest.fail("nothing is built"))
    monkeypatch.setattr(build_pybullet, "_tools", lambda place: (str(_python_in(place)), "-m", "pip"))
    monkeypatch.setattr(sys, "argv", ["build_pybullet.py", str(folders / "racers")])
    assert build_pybullet.main() == 0
    assert (folders / "racers" / NAME).read_text() == "published"
    assert {"--require-hashes", "--no-deps", "--only-binary"} <= set(ran[0])


def _python_in(place: Path) -> Path:
    return place / "env" / "bin" / "python"


def test_it_stops_at_once_where_the_cache_cannot_be_written(folders, monkeypatch):
    monkeypatch.setattr(build_pybullet, "_compiles", lambda: True)
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(build_pybullet.BuildError, match=r"cannot be kept in .*/cache: .* XDG_CACHE_HOME"):
        build_pybullet.provide()


@pytest.mark.soak
def test_the_real_source_compiles_and_a_second_checkout_takes_the_wheel(folders, monkeypatch, capsys):
    """Some 12 minutes of a processor, and the only test that asks the package index."""
    monkeypatch.setattr(sys, "argv", ["build_pybullet.py", "--build"])
    assert build_pybullet.main() == 0, capsys.readouterr().err
    assert [wheel.name for wheel in (folders / "cache").glob("*.whl")] == [NAME]
    assert " of 267 files (" in capsys.readouterr().out
    monkeypatch.setattr(build_pybullet, "_compile", lambda place: pytest.fail("compiled twice"))
    assert build_pybullet.main() == 0


@needs_compiler
def test_compiler_flags_of_the_caller_do_not_change_the_arithmetic(folders, tree, monkeypatch):
    for name in ("CFLAGS", "CXXFLAGS"):
        monkeypatch.setenv(name, "-DFUSED=1")
    (tree / "a.cpp").write_text(
        "#ifdef FUSED\n#error built with flags of the caller\n#endif\n"
        "#ifndef __OPTIMIZE__\n#error built without optimisation\n#endif\n"
    )
    build_pybullet._compile_tree(sys.executable, tree, folders / "made")

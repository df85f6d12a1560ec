"""``scripts/choose-python.sh``: which Python the virtual environment is made of, and what is printed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.shared import CHECKOUT

TOOLS = ("cat", "cp", "date", "dirname", "grep", "head", "ls", "mkdir", "mv", "rm", "sed", "timeout")
PYTHON = """#!/bin/sh
case "$*" in
*version_info\\[:3\\]*) echo {version} ;;
*ensurepip*) exit {unusable} ;;
*--state) echo {wheel} ;;
*--build) echo "build {name}" >>{asked}; [ -z "{refusal}" ] || {{ echo "{refusal}" >&2; exit 1; }} ;;
"-m venv "*)
    mkdir -p "$3/bin"
    echo "version = {version}" >"$3/pyvenv.cfg"
    cp "$0" "$3/bin/python"
    ;;
"-m pip install "*)
    echo "pip $*" >>{asked}
    cat "${{0%/bin/python}}/uv.txt" >{asked}.lock
    [ -e {asked}.uv ] || exit 1
    cp {asked}.uv "${{0%/python}}/uv"
    ;;
*) echo "unexpected: $*" >&2; exit 9 ;;
esac
"""
UV = """#!/bin/sh
echo "uv $* retries=$UV_HTTP_RETRIES mirror=$UV_PYTHON_INSTALL_MIRROR" >>{asked}
case "$*" in
--version) ;;
"python find "*) [ -e "$UV_PYTHON_INSTALL_DIR/python3.11" ] && echo "$UV_PYTHON_INSTALL_DIR/python3.11" ;;
"python install "*)
    [ -e {asked}.python ] && mkdir -p "$UV_PYTHON_INSTALL_DIR" || exit 1
    cp {asked}.python "$UV_PYTHON_INSTALL_DIR/python3.11"
    ;;
esac
"""


class Machine:
    """A folder of stubs in the place of a system; nothing else is on the path."""

    def __init__(self, folder: Path) -> None:
        self.bin, self.venv, self.asked = folder / "bin", folder / "venv", folder / "asked"
        self.cache = folder / "cache"
        self.bin.mkdir()
        for tool in TOOLS:
            (self.bin / tool).symlink_to(str(shutil.which(tool)))
        self.program(self.bin / "uname", "#!/bin/sh\necho x86_64\n")

    @staticmethod
    def program(path: Path, text: str) -> Path:
        path.write_text(text)
        path.chmod(0o755)
        return path

    def python(
        self, name: str, version: str, wheel: str = "missing", *, usable: bool = True, refusal: str = ""
    ) -> Path:
        path = Path(name) if name.startswith("/") else self.bin / name
        given = {"name": path.name, "version": version, "wheel": wheel, "refusal": refusal, "asked": self.asked}
        return self.program(path, PYTHON.format(unusable=int(not usable), **given))

    def uv(self, *, on_path: bool = True, downloads: bool = True) -> None:
        self.program(self.bin / "uv" if on_path else Path(f"{self.asked}.uv"), UV.format(asked=self.asked))
        if downloads:
            self.python(f"{self.asked}.python", "3.11.9", "published")

    def choose(self, **environment: str) -> tuple[int, str, str]:
        done = subprocess.run(
            ["/bin/sh", CHECKOUT / "scripts/choose-python.sh", self.venv],
            env={"PATH": str(self.bin), "XDG_CACHE_HOME": str(self.cache), **environment},
            capture_output=True,
            text=True,
            timeout=60,
        )
        return done.returncode, done.stdout, done.stderr

    def log(self) -> str:
        return self.asked.read_text() if self.asked.exists() else ""

    def made_of(self) -> str:
        """The version of the environment's Python; "" where none was made."""
        settings = self.venv / "pyvenv.cfg"
        return settings.read_text().split()[-1] if settings.exists() else ""


@pytest.fixture
def machine(tmp_path):
    return Machine(tmp_path)


def test_python_3_11_on_the_path_is_taken_first(machine):
    machine.python("python3", "3.13.5", "built")
    machine.python("python3.11", "3.11.2", "published")
    machine.uv()
    status, out, err = machine.choose(STEPS="4")
    assert (status, err, machine.made_of()) == (0, "", "3.11.2")
    assert out.startswith(f"[2/4] Python 3.11.2 ({machine.bin}/python3.11): found on the path\n")
    assert machine.log() == ""


def test_a_python_3_11_by_another_name_goes_before_uv(machine):
    machine.python("python3", "3.11.2", "published")
    machine.uv()
    assert machine.choose()[0] == 0
    assert (machine.made_of(), machine.log()) == ("3.11.2", "")


def test_uv_on_the_path_provides_one_where_python_3_11_cannot_make_environments(machine):
    machine.python("python3.11", "3.11.2", "published", usable=False)
    machine.uv()
    status, out, _ = machine.choose(UV_PYTHON_INSTALL_MIRROR="file:///mirror")
    assert (status, machine.made_of()) == (0, "3.11.9")
    assert "provided by uv" in out
    assert "python install --no-bin 3.11 retries=1 mirror=file:///mirror" in machine.log()


def test_uv_is_installed_by_its_locked_hash_into_the_cache(machine):
    machine.python("python3", "3.13.5")
    machine.uv(on_path=False)
    assert machine.choose()[0] == 0
    assert machine.made_of() == "3.11.9"
    assert "--require-hashes" in machine.log()
    assert sorted(path.name for path in (machine.cache / "paddock").iterdir()) == ["bin", "python"]
    first, *hashes = Path(f"{machine.asked}.lock").read_text().splitlines()
    assert first.startswith("uv==") and hashes
    assert all(line.startswith("    --hash=sha256:") for line in hashes)
    assert f"\n{first.split()[0]} " in (CHECKOUT / "locks" / "tools.txt").read_text()


def test_the_next_checkout_takes_the_downloaded_python_without_a_network(machine, tmp_path):
    machine.python("python3", "3.13.5")
    machine.uv(on_path=False)
    machine.choose()
    for gone in ("asked", "asked.uv", "asked.python"):
        (tmp_path / gone).unlink()
    machine.venv = tmp_path / "second"
    assert machine.choose()[0] == 0
    assert machine.made_of() == "3.11.9"
    assert "install" not in machine.log()


@pytest.mark.parametrize("uv", ["no index", "no download"])
def test_a_built_wheel_is_taken_where_uv_has_no_network(machine, uv):
    machine.python("python3", "3.13.5", "built")
    if uv == "no download":
        machine.uv(on_path=False, downloads=False)
    status, out, _ = machine.choose()
    assert (status, machine.made_of()) == (0, "3.13.5")
    assert "its PyBullet wheel was built before" in out
    assert "build" not in machine.log()


def test_another_python_with_a_built_wheel_goes_before_a_build(machine):
    machine.python("python3", "3.13.5")
    machine.python("python3.12", "3.12.3", "built")
    assert machine.choose()[0] == 0
    assert machine.made_of() == "3.12.3"


def test_the_wheel_is_built_where_there_is_no_other_way(machine):
    machine.python("python3", "3.13.5")
    status, out, _ = machine.choose(STEPS="4")
    assert (status, machine.made_of()) == (0, "3.13.5")
    assert "[2/4] No Python 3.11 available: compiling PyBullet for Python 3.13.5\n" in out
    assert machine.log().splitlines()[-1] == "build python3"


def test_no_environment_is_left_where_the_wheel_cannot_be_built(machine):
    machine.python("python3", "3.13.5", refusal="no compiler")
    status, _, err = machine.choose()
    assert (status, err, machine.made_of()) == (1, "no compiler\n", "")


@pytest.mark.parametrize("python", ["none", "of the wrong version"])
def test_one_sentence_says_what_to_install_where_there_is_no_python(machine, python):
    if python != "none":
        machine.python("python3", "3.9.2", usable=False)
    status, _, err = machine.choose()
    assert status == 1
    assert err == (
        "Paddock needs Python 3.11 to 3.14 with the module venv; on Debian: sudo apt-get install -y python3-venv\n"
    )


def test_uv_is_not_asked_where_no_python_has_a_published_wheel(machine):
    machine.program(machine.bin / "uname", "#!/bin/sh\necho aarch64\n")
    machine.python("python3.11", "3.11.2")
    machine.uv()
    assert machine.choose()[0] == 0
    assert machine.made_of() == "3.11.2"
    assert machine.log() == "build python3.11\n"


def test_the_named_python_goes_before_all_others(machine):
    machine.python("python3.11", "3.11.2", "published")
    machine.python("mine", "3.12.3", "built")
    status, out, _ = machine.choose(PYTHON="mine")
    assert (status, machine.made_of()) == (0, "3.12.3")
    assert "named by PYTHON" in out


def test_the_wheel_of_the_named_python_is_built(machine):
    path = machine.python("mine", "3.14.0")
    assert machine.choose(PYTHON=str(path))[0] == 0
    assert (machine.made_of(), machine.log()) == ("3.14.0", "build mine\n")


def test_a_named_python_that_cannot_be_used_is_refused(machine):
    machine.python("python3.11", "3.11.2", "published")
    status, _, err = machine.choose(PYTHON="/nowhere/python")
    assert status == 1 and err == "PYTHON=/nowhere/python does not run; name a Python 3.11 to 3.14, or none.\n"
    machine.python("old", "3.10.1", usable=False)
    status, _, err = machine.choose(PYTHON="old")
    assert status == 1 and err.startswith("PYTHON=old is Python 3.10.1: Paddock needs 3.11 to 3.14")
    assert machine.made_of() == ""


def test_a_working_environment_is_left_alone(machine):
    machine.python("python3", "3.13.5", "built")
    machine.choose()
    machine.python("python3.11", "3.11.2", "published")
    (machine.venv / "kept").touch()
    assert machine.choose() == (0, "", "")
    assert machine.choose(PYTHON="python3") == (0, "", "")
    assert (machine.venv / "kept").exists()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("gone", "its Python 3.13 is gone"),
        ("upgraded", "its Python was 3.13 and is 3.14 now"),
        ("unsupported", "Python 3.13.5 is not supported"),
        ("named", "PYTHON=python3.11 is another than its Python 3.13.5"),
    ],
)
def test_an_environment_that_no_longer_fits_is_made_anew(machine, change, why):
    machine.python("python3", "3.13.5", "built")
    machine.choose()
    (machine.venv / "old").touch()
    machine.python("python3.11", "3.11.2", "published")
    inside = machine.venv / "bin" / "python"
    if change == "gone":
        inside.unlink()
        inside.symlink_to("/nowhere/python3.13")
    elif change == "upgraded":
        machine.python(str(inside), "3.14.0")
    elif change == "unsupported":
        machine.python(str(inside), "3.13.5", usable=False)
    status, out, _ = machine.choose(**({"PYTHON": "python3.11"} if change == "named" else {}))
    assert status == 0
    assert out.startswith(f"{machine.venv} is made anew: {why}\n")
    assert machine.made_of() == "3.11.2"
    assert not (machine.venv / "old").exists()


def test_a_folder_that_is_no_environment_is_not_deleted(machine):
    machine.python("python3.11", "3.11.2", "published")
    machine.venv.mkdir()
    (machine.venv / "thesis.txt").touch()
    status, _, err = machine.choose()
    assert status == 1 and "is no virtual environment; move it away" in err
    assert (machine.venv / "thesis.txt").exists()

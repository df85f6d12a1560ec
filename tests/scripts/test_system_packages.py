"""``scripts/system-packages.sh``: what must be there, what had better be, and who is told what."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from tests.shared import CHECKOUT

ALL = ("bwrap", "python3", "gcc")


@pytest.fixture
def run(tmp_path):
    """Call it where only these programs exist; apt-get, if any, writes down what it is asked for."""

    for tool in ("date", "grep", "ls", "timeout"):
        (tmp_path / tool).symlink_to(str(shutil.which(tool)))

    def call(
        *programs: str, root: bool, apt: str | None = "exit 0", mode: tuple[str, ...] = ("run",), **environment: str
    ) -> tuple[int, str, str]:
        found = {program: "exit 0" for program in programs} | {"id": f"echo {0 if root else 1000}"}
        if apt is not None:
            found["apt-get"] = f'echo "$*" >> {tmp_path}/asked; {apt}'
        for name, body in found.items():
            (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
            (tmp_path / name).chmod(0o755)
        done = subprocess.run(
            ["/bin/sh", CHECKOUT / "scripts/system-packages.sh", *mode],
            env={"PATH": str(tmp_path), **environment},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=30,
        )
        print(done.stdout, end="")
        asked = tmp_path / "asked"
        return done.returncode, done.stderr, asked.read_text() if asked.exists() else ""

    return call


@pytest.mark.parametrize("compiler", ["cc", "gcc", "clang"])
def test_nothing_is_installed_if_nothing_is_missing(run, compiler):
    assert run("bwrap", "python3", compiler, root=True) == (0, "", "")


def test_root_installs_what_is_missing_including_the_compiler(run):
    status, _, asked = run("python3", root=True)
    assert status == 0
    assert "bubblewrap" in asked and "gcc" in asked


def test_it_continues_if_no_compiler_can_be_installed(run):
    status, said, _ = run("bwrap", "python3", root=True, apt="exit 100")
    assert status == 0 and "goes on without: gcc" in said
    assert run("bwrap", "python3", root=False)[:2] == (
        0,
        "Paddock is faster with: gcc. Type: sudo apt-get install -y gcc\n",
    )


def test_it_continues_without_a_compiler_if_there_is_no_apt(run):
    assert run("bwrap", "python3", root=False, apt=None) == (0, "", "")


def test_it_stops_without_bubblewrap(run):
    status, said, _ = run("python3", "gcc", root=False)
    assert status == 1 and "sudo apt-get install -y bubblewrap\n" in said
    status, said, _ = run("python3", root=False, apt=None)
    assert status == 1 and "bubblewrap" in said and "gcc" not in said
    status, said, _ = run("python3", "gcc", root=True, apt="exit 100")
    assert status == 1 and "which apt-get could not install: bubblewrap. " in said


def test_the_first_setup_says_that_nothing_is_missing(run, tmp_path, capsys):
    assert run(*ALL, root=True, STEPS="4") == (0, "", "")
    assert capsys.readouterr().out == "[1/4] System packages: nothing is missing\n"
    (tmp_path / ".venv").mkdir()
    assert run(*ALL, root=True, STEPS="4") == (0, "", "")
    assert capsys.readouterr().out == ""


def test_a_python_that_makes_environments_is_enough_by_any_name(run, tmp_path):
    assert run("bwrap", "gcc", "python3.11", root=True) == (0, "", "")
    (tmp_path / "python3.11").unlink()
    assert run("bwrap", "gcc", "mine", root=True, PYTHON="mine") == (0, "", "")
    (tmp_path / "mine").unlink()
    assert "python3-venv" in run("bwrap", "gcc", root=True)[2]


def test_the_compiler_is_part_of_the_second_step(run, capsys):
    run(root=True, mode=("build", "python3.13-dev"), STEPS="4")
    assert capsys.readouterr().out.startswith("Installing g++ python3.13-dev\n")
    run(root=True, STEPS="4")
    assert capsys.readouterr().out.startswith("[1/4] Installing bubblewrap ")


def test_the_compiler_of_pybullet_comes_with_the_headers_of_the_right_python(run):
    status, said, asked = run(root=True, mode=("build", "python3.13-dev"))
    assert (status, said) == (0, "")
    assert asked.splitlines()[-1].endswith(" g++ python3.13-dev")
    status, said, _ = run(root=False, mode=("build", "python3.13-dev"))
    assert status == 1 and "    sudo apt-get update && sudo apt-get install -y g++ python3.13-dev\n" in said
    status, said, _ = run("dpkg-query", root=False, mode=("build", "python3.13-dev"))
    assert status == 1 and said.endswith("install -y g++\n"), "the headers are there"


@pytest.mark.parametrize(("system", "installed"), [("debian", True), ("ubuntu", False)])
def test_chromium_is_installed_where_its_package_is_not_an_empty_one(run, tmp_path, system, installed):
    (tmp_path / "os-release").write_text(f"NAME=any\nID={system}\n")
    _, _, asked = run(*ALL, root=True, mode=("test",), OS_RELEASE=str(tmp_path / "os-release"))
    assert (" chromium " in asked) is (" chromium-headless-shell\n" in asked) is installed
    assert " redis-server " in asked


def test_what_compiles_python_ldap_is_installed_or_named(run, tmp_path):
    packages = " libldap2-dev libsasl2-dev gcc python3-dev"
    environment = {"mode": ("ldap",), "INCLUDE": str(tmp_path)}
    status, said, _ = run(root=False, **environment)
    assert status == 1 and f"apt-get install -y{packages}\n" in said
    assert run(root=True, **environment)[2].splitlines()[-1].endswith(packages)
    for header in ("ldap.h", "sasl/sasl.h"):
        (tmp_path / header).parent.mkdir(exist_ok=True)
        (tmp_path / header).touch()
    assert run("gcc", root=False, **environment)[1].endswith("install -y python3-dev\n")


def test_tests_want_a_directory_and_go_on_without(run, tmp_path):
    places = {"INCLUDE": str(tmp_path), "SBIN": str(tmp_path)}
    status, said, asked = run("uname", root=True, mode=("test",), apt="case $* in *slapd*) exit 100;; esac", **places)
    assert status == 0 and "goes on without:" in said
    assert " slapd libldap2-dev libsasl2-dev" in asked


@pytest.fixture
def playwright(tmp_path):
    """A stub of the environment's Python that records what it runs."""

    def install(status: int) -> None:
        python = tmp_path / ".venv" / "bin" / "python"
        python.parent.mkdir(parents=True, exist_ok=True)
        python.write_text(f'#!/bin/sh\necho "$*" >>{tmp_path}/asked\nexit {status}\n')
        python.chmod(0o755)

    return install


@pytest.mark.parametrize(("root", "options"), [(True, "--with-deps chromium"), (False, "chromium")])
def test_playwright_brings_its_chromium_where_no_package_does(run, playwright, root, options):
    playwright(0)
    status, said, asked = run(root=root, mode=("browser",))
    assert (status, said, asked) == (0, "", f"-m playwright install {options}\n")


def test_without_a_browser_the_tests_go_on_and_one_line_has_the_command(run, playwright):
    playwright(1)
    status, said, _ = run(root=False, mode=("browser",))
    assert status == 0 and said.startswith("Tests in a browser are skipped: ")
    assert "-m playwright install chromium" in said


@pytest.mark.parametrize("browser", ["chromium", "google-chrome"])
def test_nothing_is_downloaded_where_there_is_a_browser(run, browser):
    assert run(browser, root=True, mode=("browser",)) == (0, "", "")

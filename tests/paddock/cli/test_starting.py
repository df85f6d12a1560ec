"""``paddock new`` and ``paddock completion``."""

from __future__ import annotations

import ast
import shutil
import subprocess

import pytest

from tests.shared import CHECKOUT


def test_a_starter_project_trains_exports_and_submits(paddock, tmp_path):
    said = paddock("new", tmp_path / "car")
    assert said.status == 0
    text = (tmp_path / "car/train_a_car.py").read_text()
    names = {node.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)}
    assert names >= {"train", "export", "submit"} and "reward_function" in names
    assert text == (CHECKOUT / "training/examples/train_a_car.py").read_text()
    action = (tmp_path / "car/.github/workflows/submit.yml").read_text()
    assert "paddock submit car.zip" in action and "secrets.PADDOCK_TOKEN" in action


def test_nothing_is_overwritten(paddock, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    said = paddock("new", tmp_path)
    assert (said.code, said.status) == ("home_exists", 2)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_the_docs_show_the_same_action(paddock):
    starter = (CHECKOUT / "paddock/cli/starter/submit.yml").read_text()
    assert (CHECKOUT / "docs/examples/submit.yml").read_text() == starter


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_completes_every_command_and_option(paddock, shell):
    said = paddock("completion", shell)
    for word in [
        "login",
        "races",
        "tracks",
        "upload",
        "submit",
        "evaluate",
        "verify",
        "board",
        "download",
        "export",
        "new",
        "models",
        "runs",
        "submissions",
        "train",
        "logs",
        "video",
    ]:
        assert word in said.out
    assert "wait" in said.out and "trace-only" in said.out and "withdraw" in said.out and "follow" in said.out
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=said.out, text=True, check=True)


def test_bash_offers_what_begins_so(paddock):
    script = paddock("completion", "bash").out
    asked = 'COMP_WORDS=(paddock su); COMP_CWORD=1; _paddock; echo "${COMPREPLY[@]}"; '
    asked += 'COMP_WORDS=(paddock submit --w); COMP_CWORD=2; _paddock; echo "${COMPREPLY[@]}"; '
    asked += 'COMP_WORDS=(paddock train st); COMP_CWORD=2; _paddock; echo "${COMPREPLY[@]}"'
    done = subprocess.run(["bash"], input=f"{script}\n{asked}", capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["submit", "submissions", "--wait", "start", "stop"]

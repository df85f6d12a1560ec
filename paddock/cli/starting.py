"""Commands that begin something: ``new``, a starter project; ``completion``, the names of commands for a shell."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from paddock.errors import PlatformFault, UserFault

from .asking import Call

EXAMPLE = "train_a_car.py"
# in the package, and in the project
FILES = {EXAMPLE: EXAMPLE, "README.md": "README.md", "submit.yml": ".github/workflows/submit.yml"}


def new(asked: Call, options: argparse.Namespace) -> int:
    """Write a starter project into a folder that is empty or not there."""
    folder = Path(options.folder)
    try:
        if folder.exists() and any(folder.iterdir()):
            raise UserFault("home_exists", path=str(folder))
        for name, to in FILES.items():
            target = folder / to
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(_starter(name), encoding="utf-8")
    except OSError as error:
        raise UserFault("home_file_unwritable", path=str(folder), problem=error.strerror or str(error)) from error
    made = [str(folder / to) for to in FILES.values()]
    asked.speaker.result({"files": made}, "\n".join([*made, f"Begin with {folder / 'README.md'}."]))
    return 0


def _starter(name: str) -> str:
    """A file of the starter. The example is put beside the others when the package is built; in a checkout it is
    where the site has it."""
    inside = files(__package__) / "starter" / name
    if inside.is_file():
        return inside.read_text(encoding="utf-8")
    checkout = Path(__file__).resolve().parents[2] / "training" / "examples" / name
    if not checkout.is_file():
        raise PlatformFault("drive_failed", problem=f"the package has no {name}")
    return checkout.read_text(encoding="utf-8")


def completion(asked: Call, options: argparse.Namespace) -> int:
    """Print what a shell is to read so that it completes commands and options."""
    named = dict(_words(options.parser))
    text = {"bash": _bash, "zsh": _zsh, "fish": _fish}[options.shell](named)
    asked.speaker.result({"shell": options.shell, "script": text}, text)
    return 0


def _words(parser: argparse.ArgumentParser) -> Iterator[tuple[str, tuple[str, list[str]]]]:
    """Of each command its help and its options."""
    (commands,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    helps = {choice.dest: choice.help or "" for choice in commands._choices_actions}
    for name, one in commands.choices.items():
        known = [option for each in one._actions for option in each.option_strings if option.startswith("--")]
        yield name, (helps.get(name, ""), known)


def _bash(named: dict[str, tuple[str, list[str]]]) -> str:
    cases = "\n".join(f'    {name}) words="{" ".join(options)}" ;;' for name, (_, options) in named.items())
    return f"""# bash: eval "$(paddock completion bash)"
_paddock() {{
  local words="" word="${{COMP_WORDS[COMP_CWORD]}}"
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{" ".join(named)}" -- "$word")); return
  fi
  case "${{COMP_WORDS[1]}}" in
{cases}
  esac
  case "$word" in -*) COMPREPLY=($(compgen -W "$words" -- "$word")) ;; *) COMPREPLY=($(compgen -f -- "$word")) ;; esac
}}
complete -o filenames -F _paddock paddock"""


def _zsh(named: dict[str, tuple[str, list[str]]]) -> str:
    commands = "\n".join(f"    '{name}:{help_of.replace(chr(39), '')}'" for name, (help_of, _) in named.items())
    cases = "\n".join(f"    {name}) compadd -- {' '.join(options)} ;;" for name, (_, options) in named.items())
    return f"""#compdef paddock
# zsh: eval "$(paddock completion zsh)"
_paddock() {{
  local -a commands=(
{commands}
  )
  if (( CURRENT == 2 )); then _describe command commands; return; fi
  if [[ $words[CURRENT] != -* ]]; then _files; return; fi
  case $words[2] in
{cases}
  esac
}}
compdef _paddock paddock"""


def _fish(named: dict[str, tuple[str, list[str]]]) -> str:
    lines = ["# fish: paddock completion fish | source"]
    for name, (help_of, options) in named.items():
        quoted = help_of.replace("'", "")
        lines.append(f"complete -c paddock -n __fish_use_subcommand -f -a {name} -d '{quoted}'")
        lines += [f"complete -c paddock -n '__fish_seen_subcommand_from {name}' -l {one[2:]}" for one in options]
    return "\n".join(lines)

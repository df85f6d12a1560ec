"""The commands ``new`` (a starter project) and ``completion`` (for shells)."""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from paddock.errors import PlatformFault, UserFault

from .asking import Call
from .commands import parser
from .files import UNWRITABLE, file_faults

EXAMPLE = "train_a_car.py"
# in the package, and in the project
FILES = {EXAMPLE: EXAMPLE, "README.md": "README.md", "submit.yml": ".github/workflows/submit.yml"}


def new(asked: Call, options: argparse.Namespace) -> int:
    folder = Path(options.folder)
    with file_faults(UNWRITABLE, folder):
        if folder.exists() and any(folder.iterdir()):
            raise UserFault("home_exists", path=str(folder))
        for name, to in FILES.items():
            target = folder / to
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(_starter(name), encoding="utf-8")
    made = [str(folder / to) for to in FILES.values()]
    asked.speaker.result({"files": made}, "\n".join([*made, f"Begin with {folder / 'README.md'}."]))
    return 0


def _starter(name: str) -> str:
    """A file of the starter project. In a checkout the example lies in the site's folder, in the package beside the
    other files."""
    inside = files(__package__) / "starter" / name
    if inside.is_file():
        return inside.read_text(encoding="utf-8")
    checkout = Path(__file__).resolve().parents[2] / "training" / "examples" / name
    if not checkout.is_file():
        raise PlatformFault("drive_failed", problem=f"the package has no {name}")
    return checkout.read_text(encoding="utf-8")


def completion(asked: Call, options: argparse.Namespace) -> int:
    named = dict(_words(parser()))
    text = {"bash": _bash, "zsh": _zsh, "fish": _fish}[options.shell](named)
    asked.speaker.result({"shell": options.shell, "script": text}, text)
    return 0


@dataclass(frozen=True)
class _Words:
    """Of a command: its help, its options (with those of its verbs), and its verbs."""

    help: str
    options: list[str]
    verbs: list[str]


def _words(top: argparse.ArgumentParser) -> Iterator[tuple[str, _Words]]:
    for action in top._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, one in action.choices.items():
                known = [option for each in one._actions for option in each.option_strings if option.startswith("--")]
                verbs = dict(_words(one))
                known += [option for each in verbs.values() for option in each.options]
                yield name, _Words(helps.get(name, ""), list(dict.fromkeys(known)), list(verbs))


def _lines(named: dict[str, _Words], form: str, with_verbs: bool = False) -> str:
    """A line for each command, or for each with verbs."""
    return "\n".join(
        form.format(name=name, help=one.help.replace("'", ""), options=" ".join(one.options), verbs=" ".join(one.verbs))
        for name, one in named.items()
        if one.verbs or not with_verbs
    )


def _bash(named: dict[str, _Words]) -> str:
    verbs = '    {name}) COMPREPLY=($(compgen -W "{verbs}" -- "$word")); return ;;'
    return f"""# bash: eval "$(paddock completion bash)"
_paddock() {{
  local words="" word="${{COMP_WORDS[COMP_CWORD]}}"
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{" ".join(named)}" -- "$word")); return
  fi
  if [ "$COMP_CWORD" -eq 2 ]; then case "${{COMP_WORDS[1]}}" in
{_lines(named, verbs, with_verbs=True)}
  esac; fi
  case "${{COMP_WORDS[1]}}" in
{_lines(named, '    {name}) words="{options}" ;;')}
  esac
  case "$word" in -*) COMPREPLY=($(compgen -W "$words" -- "$word")) ;; *) COMPREPLY=($(compgen -f -- "$word")) ;; esac
}}
complete -o filenames -F _paddock paddock"""


def _zsh(named: dict[str, _Words]) -> str:
    return f"""#compdef paddock
# zsh: eval "$(paddock completion zsh)"
_paddock() {{
  local -a commands=(
{_lines(named, "    '{name}:{help}'")}
  )
  if (( CURRENT == 2 )); then _describe command commands; return; fi
  if (( CURRENT == 3 )); then case $words[2] in
{_lines(named, "    {name}) compadd -- {verbs}; return ;;", with_verbs=True)}
  esac; fi
  if [[ $words[CURRENT] != -* ]]; then _files; return; fi
  case $words[2] in
{_lines(named, "    {name}) compadd -- {options} ;;")}
  esac
}}
compdef _paddock paddock"""


def _fish(named: dict[str, _Words]) -> str:
    lines = ["# fish: paddock completion fish | source"]
    for name, one in named.items():
        quoted = one.help.replace("'", "")
        lines.append(f"complete -c paddock -n __fish_use_subcommand -f -a {name} -d '{quoted}'")
        if one.verbs:
            lines.append(f"complete -c paddock -n '__fish_seen_subcommand_from {name}' -f -a '{' '.join(one.verbs)}'")
        lines += [f"complete -c paddock -n '__fish_seen_subcommand_from {name}' -l {each[2:]}" for each in one.options]
    return "\n".join(lines)

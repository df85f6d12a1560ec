"""The command line: what can be asked, and the exit status of what came of it.

0: done, and well. 1: done, and the outcome is not what was hoped for (the run failed, a hash differs). 2: refused, with
the reason. 3: the site or Paddock failed, or there is nothing to compare. 130: interrupted.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from typing import Any, NoReturn

from paddock.errors import PaddockError, UserFault
from paddock.packages.kinds import CAR, EXPORTS
from paddock.simulator.engine import ENGINE_ID

from .asking import Call
from .showing import Speaker
from .site import SiteRefusal

REFUSED, FAILED, INTERRUPTED = 2, 3, 130
_NOT_COMPARED = ("engine_differs", "result_not_there")
Command = Callable[[Call, argparse.Namespace], int]


# What comes of an answer whose parts are of other kinds than a Paddock's.
_STRANGE = (TypeError, ValueError, LookupError, AttributeError, ArithmeticError)


class _Parser(argparse.ArgumentParser):
    def __init__(self, **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)  # --js would be taken for --json by one half of us

    def error(self, message: str) -> NoReturn:
        raise UserFault("home_command_line", problem=message.rstrip("."))


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    top = _Parser(prog="paddock", description="Race from home: try cars as a site does, send them, prove results.")
    top.add_argument("--version", action="version", version=f"paddock-racing {_version()}, engine {ENGINE_ID}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)

    def add(name: str, help_: str, of: str) -> argparse.ArgumentParser:
        one: argparse.ArgumentParser = commands.add_parser(name, help=help_, description=f"{help_}.")
        one.add_argument("--json", action="store_true", help="print the outcome as one JSON value")
        one.add_argument("--site", default="", metavar="URL", help="which site; else PADDOCK_SITE, else the last login")
        one.set_defaults(run=of, parser=top)
        return one

    one = add("login", "keep a token of a site", "looking:login")
    one.add_argument("url", nargs="?", default="", metavar="URL", help="the site's address")
    one.add_argument("--name", default="", metavar="ALIAS", help="ask for the password, and make a token with it")
    one = add("logout", "forget the token of a site", "looking:logout")
    one.add_argument("url", nargs="?", default="", metavar="URL", help="the site's address")
    one.add_argument("--revoke", action="store_true", help="make it worthless on the site, too")
    one = add("races", "list races", "looking:races")
    one.add_argument("--state", choices=("open", "upcoming", "closed", "all"), default="open", help="default: open")
    one.add_argument("--mine", action="store_true", help="only those that you are in or organise")
    one = add("tracks", "list tracks; without a site those of this package", "looking:tracks")
    one.add_argument("--search", default="", metavar="TEXT", help="part of a name or an address")
    one.add_argument("--sort", default="", metavar="BY", help="name, length, width, corners, difficulty, record, raced")
    one = add("board", "show the board of a race", "looking:board")
    one.add_argument("race", metavar="RACE", help="the address of its page, or the last part of that")
    one.add_argument("--page", type=int, default=1, metavar="N")
    one = add("upload", "put a model into your garage", "sending:upload")
    _model(one)
    one.add_argument("--name", default="", help="what it is called; default: the file's name")
    one = add("submit", "send a car to a race", "sending:submit")
    _model(one, "; or the id of a model in your garage")
    one.add_argument("race", metavar="RACE", help="the address of its page, or the last part of that")
    one.add_argument("--name", default="", help="what a new model is called; default: the file's name")
    one.add_argument("--wait", action="store_true", help="wait for the result, and show it")
    one.add_argument("--timeout", type=float, default=3600.0, metavar="SECONDS", help="wait so long; default: an hour")
    one = add("download", "fetch a model as a zip of ONNX and metadata, or all files of a run", "sending:download")
    one.add_argument("what", metavar="WHAT", help="the address of a model or of a run, or a model's id")
    one.add_argument("to", nargs="?", default="", metavar="FILE", help="where to; default: named after it, here")
    one = add("export", "write a model for physical cars, or for OpenVINO", "sending:export")
    _model(one, "; or the id or the address of a model on a site")
    one.add_argument("--form", choices=EXPORTS, default=CAR, help="car: model.tar.gz of the old console; default: car")
    one.add_argument("--to", default="", metavar="FILE", help="where to; default: named after the form, here")
    one = add("evaluate", "drive a car at home, as the site would", "rehearsing:evaluate")
    _model(one)
    where = one.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--race", default="", metavar="RACE", help="by the rules of this race, and compare with the site"
    )
    where.add_argument(
        "--track", default="", metavar="TRACK", help="on a track of the catalogue by any of its names, or an .npy file"
    )
    one.add_argument("--rule", action="append", default=[], metavar="NAME=VALUE", help="with --track: a rule of a run")
    one.add_argument("--look", default="", choices=("official", "textures", "bold"), help="with --track")
    one.add_argument("--rival", action="append", default=[], metavar="FILE", help="another car in the same race")
    one.add_argument("--trace", default="", metavar="FILE", help="write the sim-trace (CSV) there")
    one = add("verify", "prove a result at home: fetch, drive, compare", "proving:verify")
    one.add_argument("result", metavar="RESULT", help="the address of its page, or its id")
    one.add_argument("--trace-only", action="store_true", help="leave the networks out, also where they are open")
    one = add("new", "write a starter project: train, export, submit", "starting:new")
    one.add_argument("folder", metavar="FOLDER", help="one that is empty or not there")
    one = add("completion", "print what completes commands in a shell", "starting:completion")
    one.add_argument("shell", choices=("bash", "zsh", "fish"))
    return top


def _model(one: argparse.ArgumentParser, more: str = "") -> None:
    help_ = f"an archive, or a network and its model_metadata.json (and its .data file){more}"
    one.add_argument("model", nargs="+", metavar="MODEL", help=help_)
    one.add_argument("--checkpoint", default="", metavar="WHICH", help="of a training's folder: best, last, a number")


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what is asked; the exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    speaker = Speaker("--json" in given)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a name that this terminal has no letters for is no failure
    try:
        options = parser().parse_args(given)
        return _called(Call(speaker, options.site), options)
    except PaddockError as fault:
        _tell(speaker, {**fault.to_dict(), "message": str(fault)})
        return REFUSED if isinstance(fault, UserFault) and fault.code not in _NOT_COMPARED else FAILED
    except SiteRefusal as refusal:
        _tell(speaker, refusal.said)
        return FAILED if refusal.theirs else REFUSED
    except KeyboardInterrupt:
        speaker.note("Interrupted. What was sent to the site goes on there.")
        return INTERRUPTED
    except BrokenPipeError:  # whoever reads has seen enough
        sys.stderr.close()
        return 0


def _called(asked: Call, options: argparse.Namespace) -> int:
    try:
        return _command(options.run)(asked, options)
    except _STRANGE as error:
        if not asked.asked_site:
            raise
        said = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        raise UserFault(
            "site_is_no_paddock", site=asked.asked_site, problem=f"its answer is strange, {said}"
        ) from error


def _command(name: str) -> Command:
    """The function of a command; its module is loaded for it alone, so that looking needs no simulator."""
    from importlib import import_module

    module, _, function = name.partition(":")
    found: Command = getattr(import_module(f"{__package__}.{module}"), function)
    return found


def _tell(speaker: Speaker, fault: dict[str, object]) -> None:
    if speaker.as_json:
        speaker.result({"error": fault}, "")
    speaker.note(f"{fault['code']}: {fault['message']}")


def _version() -> str:
    try:
        return metadata.version("paddock-racing")
    except metadata.PackageNotFoundError:  # from the site's checkout
        return "(checkout)"


if __name__ == "__main__":
    sys.exit(main())

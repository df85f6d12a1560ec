"""The list of all commands with their options, each with the function that runs it as ``module:function``."""

import argparse
import shutil
from collections.abc import Callable
from functools import cache
from typing import Any, NoReturn

from paddock.errors import UserFault
from paddock.packages.kinds import CAR, EXPORTS
from paddock.simulator.engine import ENGINE_ID

EXIT_STATUS = (
    "Exit status: 0 done; 1 done, but the run or training failed, a hash differs, or models of a folder failed; "
    "2 refused, with the reason; 3 the site or Paddock failed; 130 interrupted."
)


Add = Callable[..., argparse.ArgumentParser]


class _Formatter(argparse.HelpFormatter):
    """Argparse makes one formatter for each argument; read the width of the terminal once."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=_width())


@cache
def _width() -> int:
    return shutil.get_terminal_size().columns - 2


class _Parser(argparse.ArgumentParser):
    def __init__(self, **options: Any) -> None:
        # :mod:`.main` looks for the whole word --json
        super().__init__(**options, formatter_class=_Formatter, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        raise UserFault("home_command_line", problem=message.rstrip("."))


class _Version(argparse.Action):
    """Print the version. Only then it is looked up: importlib.metadata takes a third of the start of a command."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        print(f"paddock-racing {_version()}, engine {ENGINE_ID}")
        parser.exit()


class _Other:
    """A command that was not asked for: it takes no arguments. To build all commands takes ten milliseconds."""

    def __getattr__(self, _name: str) -> Callable[..., Any]:
        return lambda *_, **__: self


def parser(asked: str = "") -> argparse.ArgumentParser:
    """The parser of all commands, or only of the command ``asked`` if there is one of this name."""
    description = "Race from home: try cars as a site does, send them, prove results."
    top = _Parser(prog="paddock", description=description, epilog=EXIT_STATUS)
    top.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)

    def add(name: str, help_: str, of: str, within: Any = commands) -> Any:
        if (within is commands and asked not in ("", name)) or isinstance(within, _Other):
            return _Other()
        one: argparse.ArgumentParser = within.add_parser(
            name, help=help_, description=f"{help_[0].upper()}{help_[1:]}.", epilog=EXIT_STATUS
        )
        one.add_argument("--json", action="store_true", help="print the outcome as one JSON value")
        one.add_argument("--site", default="", metavar="URL", help="which site; else PADDOCK_SITE, else the last login")
        one.set_defaults(run=of, of_many=False)
        return one

    def group(name: str, help_: str) -> Any:
        if asked not in ("", name):
            return _Other()
        one = commands.add_parser(name, help=help_, description=f"{help_[0].upper()}{help_[1:]}.")
        return one.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=_Parser)

    one = add("login", "keep a token of a site", "looking:login")
    _to(one, "the site's address", "url", "URL")
    one.add_argument("--name", default="", metavar="ALIAS", help="ask for the password, and make a token with it")
    one = add("logout", "forget the token of a site", "looking:logout")
    _to(one, "the site's address", "url", "URL")
    one.add_argument("--revoke", action="store_true", help="make it worthless on the site, too")
    one = add("races", "list races", "looking:races")
    one.add_argument("--state", choices=("open", "upcoming", "closed", "all"), default="open", help="default: open")
    one.add_argument("--mine", action="store_true", help="only those that you are in or organise")
    one = add("tracks", "list tracks; without a site those of this package", "looking:tracks")
    one.add_argument("--search", default="", metavar="TEXT", help="part of a name or an address")
    one.add_argument("--sort", default="", metavar="BY", help="name, length, width, corners, difficulty, record, raced")
    one = add("board", "show the board of a race", "looking:board")
    _race(one)
    one.add_argument("--page", type=int, default=1, metavar="N")
    _upload(add("upload", "put a model into your garage", "sending:upload"))
    _submit(add("submit", "send a car to a race", "sending:submit"))
    one = add("download", "fetch a model as a zip of ONNX and metadata, or all files of a run", "downloads:download")
    one.add_argument("what", metavar="WHAT", help="the address of a model or of a run, or a model's id")
    _to(one, "where to; default: named after it, here")
    one = add("export", "write a model for physical cars, or for OpenVINO", "downloads:export")
    _model(one, "; or the id or the address of a model on a site")
    one.add_argument("--form", choices=EXPORTS, default=CAR, help="car: model.tar.gz of the old console; default: car")
    one.add_argument("--to", default="", metavar="FILE", help="where to; default: named after the form, here")
    one = add("evaluate", "drive a car at home, as the site would", "rehearsing:evaluate")
    _model(one)
    _where(
        one,
        "by the rules of this race, and compare with the site",
        "on a track of the catalogue by any of its names, or an .npy file",
    )
    one.add_argument("--look", default="", choices=("official", "textures", "bold"), help="with --track")
    one.add_argument("--rival", action="append", default=[], metavar="FILE", help="another car in the same race")
    one.add_argument("--trace", default="", metavar="FILE", help="write the sim-trace (CSV) there")
    one = add("verify", "prove a result at home: fetch, drive, compare", "proving:verify")
    one.add_argument("result", metavar="RESULT", help="the address of its page, or its id")
    one.add_argument("--trace-only", action="store_true", help="leave the networks out, also where they are open")
    _of_models(add, group("models", "list, show, upload, download, rename and delete your models"))
    _of_runs(add, group("runs", "start private evaluations of your models, and read and download them"))
    verbs = group("submissions", "list your submissions, submit a car, withdraw from a race")
    one = add("list", "list your submissions to a race, or to all", "sending:list_submissions", verbs)
    _to(one, "the address of its page, or its last part", "race", "RACE")
    _submit(add("submit", "send a car to a race", "sending:submit", verbs))
    one = add("withdraw", "leave a race", "sending:withdraw", verbs)
    _race(one)
    _yes(one)
    _of_trainings(add, group("train", "train on a site: start a training, watch it, stop it"))
    one = add("logs", "download the logs of a run or a training as a zip", "downloads:logs")
    one.add_argument("what", metavar="WHAT", help="the address or the id of a run or a training")
    _to(one)
    one.add_argument("--follow", action="store_true", help="show its progress and download when it has ended")
    _timeout(one)
    one = add("video", "make a video of a run and download it", "downloads:video")
    one.add_argument("run_id", metavar="RUN", help="its address or id")
    _to(one)
    one.add_argument("--part", default="best", metavar="PART", help="best (its fastest lap), whole, or a lap's number")
    one.add_argument("--car", type=int, default=0, metavar="N", help="the car to follow; default: 0, the run's own")
    one.add_argument("--language", default="", metavar="CODE", help="of the words in the picture: en or ko")
    _timeout(one)
    one = add("new", "write a starter project: train, export, submit", "starting:new")
    one.add_argument("folder", metavar="FOLDER", help="an empty or new folder")
    one = add("completion", "print what completes commands in a shell", "starting:completion")
    one.add_argument("shell", choices=("bash", "zsh", "fish"))
    return top if commands.choices else parser()


def _of_models(add: Add, verbs: Any) -> None:
    def of_one(verb: str, help_: str) -> argparse.ArgumentParser:
        one = add(verb, help_, f"models:{verb}", verbs)
        one.add_argument("model_id", metavar="MODEL", help="its id, its address, or its name in your garage")
        return one

    one = add("list", "list your models", "models:list_models", verbs)
    one.add_argument("--search", default="", metavar="TEXT", help="part of a name")
    one.add_argument("--sort", default="", metavar="BY", help="newest, driven, name, algorithm, weights")
    one.add_argument("--shared", action="store_true", help="models that racers share, in place of yours")
    _upload(add("upload", "put a model into your garage", "sending:upload", verbs))
    of_one("show", "show a model")
    one = of_one("download", "download a model")
    _to(one)
    help_ = "package: zip of ONNX and metadata (default); upload: the file as it was uploaded; car, openvino"
    one.add_argument("--form", default="package", choices=("package", "upload", *EXPORTS), help=help_)
    of_one("rename", "rename a model").add_argument("name", metavar="NAME", help="the new name")
    _yes(of_one("delete", "delete a model from your garage"))


def _of_runs(add: Add, verbs: Any) -> None:
    def of_one(verb: str, help_: str) -> argparse.ArgumentParser:
        one = add(verb, help_, f"runs:{verb}", verbs)
        one.add_argument("run_id", metavar="RUN", help="its address or id")
        return one

    one = add("list", "list your private runs", "runs:list_runs", verbs)
    for name in ("state", "track", "model", "race"):
        one.add_argument(f"--{name}", default="", metavar=name.upper(), help=f"only those of this {name}")
    one = add("start", "drive a model on the site, for you alone", "runs:start", verbs)
    _model(one, "; or the id of a model in your garage")
    _where(one, "by the rules of this race", "on this track, with rules of --rule")
    one.add_argument("--name", default="", help="name of a new model; default: the file's name")
    one.add_argument("--rival", action="append", default=[], metavar="MODEL", help="another model in the same run")
    one.add_argument("--submit-if-better", action="store_true", help="with --race: send the car if the run is better")
    one.add_argument("--wait", action="store_true", help="wait for the result")
    _timeout(one)
    of_one("show", "show a run")
    _timeout(of_one("wait", "wait for the end of a run, and show it"))
    of_one("stop", "stop a run")
    _yes(of_one("delete", "delete a private run that has ended"))
    one = of_one("download", "download the trace, the metrics or all logs of a run")
    _to(one)
    one.add_argument("--what", default="logs", choices=("logs", "trace", "metrics"), help="default: logs (zip)")
    one.add_argument("--car", type=int, default=0, metavar="N", help="of trace and metrics; default: 0")


def _of_trainings(add: Add, verbs: Any) -> None:
    def of_one(verb: str, help_: str) -> argparse.ArgumentParser:
        one = add(verb, help_, f"train:{verb}", verbs)
        one.add_argument("training_id", metavar="TRAINING", help="its address or id")
        return one

    add("list", "list your trainings", "train:list_trainings", verbs)
    one = add("start", "start a training from a reward file and settings", "train:start", verbs)
    one.add_argument("reward", metavar="REWARD", help="a file with the reward function")
    one.add_argument("--track", default="", metavar="TRACK", help="where to train")
    one.add_argument("--name", default="", help="default: the reward file's name")
    one.add_argument("--settings", default="", metavar="FILE", help="a JSON object as POST /trainings/ takes it")
    help_ = "one setting: hyperparameters.lr=0.0005"
    one.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help=help_)
    one.add_argument("--wait", action="store_true", help="watch it until it has ended")
    _timeout(one)
    of_one("show", "show a training")
    _timeout(of_one("watch", "show the progress of a training until it has ended"))
    of_one("stop", "stop a training; its best and last model are kept")


def _model(one: argparse.ArgumentParser, more: str = "") -> None:
    help_ = (
        "an archive, or a network and its model_metadata.json (and its .data file), or a folder: an unpacked model, "
        f"or one with many models{more}"
    )
    one.add_argument("model", nargs="+", metavar="MODEL", help=help_)
    one.add_argument("--checkpoint", default="", metavar="WHICH", help="of a training's folder: best, last, a number")


def _race(one: argparse.ArgumentParser) -> None:
    one.add_argument("race", metavar="RACE", help="the address of its page, or its last part")


def _to(
    one: argparse.ArgumentParser, help_: str = "default: named after it, here", name: str = "to", metavar: str = "FILE"
) -> None:
    one.add_argument(name, nargs="?", default="", metavar=metavar, help=help_)


def _where(one: argparse.ArgumentParser, race: str, track: str) -> None:
    where = one.add_mutually_exclusive_group(required=True)
    where.add_argument("--race", default="", metavar="RACE", help=race)
    where.add_argument("--track", default="", metavar="TRACK", help=track)
    one.add_argument("--rule", action="append", default=[], metavar="NAME=VALUE", help="with --track: a rule of a run")


def _upload(one: argparse.ArgumentParser) -> None:
    _model(one)
    one.add_argument("--name", default="", help="its name in the garage; default: the file's name")


def _submit(one: argparse.ArgumentParser) -> None:
    _model(one, "; or the id of a model in your garage")
    _race(one)
    one.add_argument("--name", default="", help="name of a new model; default: the file's name")
    one.add_argument("--wait", action="store_true", help="wait for the result, and show it")
    _timeout(one)


def _timeout(one: argparse.ArgumentParser) -> None:
    one.add_argument("--timeout", type=float, default=3600.0, metavar="SECONDS", help="wait so long; default: an hour")


def _yes(one: argparse.ArgumentParser) -> None:
    one.add_argument("--yes", action="store_true", help="do not ask for confirmation")


def _version() -> str:
    from importlib import metadata

    try:
        return metadata.version("paddock-racing")
    except metadata.PackageNotFoundError:  # from the site's checkout
        return "(checkout)"

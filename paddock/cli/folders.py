"""Finds the models in a folder, so that a command can handle one after the other."""

# Symbolic links are skipped, so nothing outside the folder is read. Reading is bounded.

import argparse
import itertools
import os
import tarfile
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn, NotRequired, TypedDict

from paddock.errors import PaddockError, UserFault
from paddock.packages.choose import METADATA, is_network
from paddock.packages.kinds import has_network_name, is_weights_file, network_suffixes
from paddock.packages.limits import DEFAULT_LIMITS

from .asking import Call, Command
from .files import UNREADABLE, file_faults
from .showing import Speaker, table
from .site import ErrorDocument, SiteRefusal, error_of

SOME_FAILED = 1
MOST_ENTRIES, MOST_DEPTH, MOST_MODELS = 20_000, 8, 500
ARCHIVES = (".tar.gz", ".tgz", ".tar.xz", ".tar.bz2", ".tar", ".zip")
# errors that every other model of the folder would meet, too
_FINAL = {"token_missing", "token_refused", "site_missing", "site_unreachable", "site_elsewhere", "site_is_no_paddock"}


@dataclass(frozen=True)
class FoundModel:
    """A model in a folder: its files, or with ``unpacked`` the files below this folder that belong to it."""

    name: str
    files: list[Path]
    unpacked: Path | None = None


def _files_in(top: Path) -> tuple[list[Path], int]:
    """The files in a folder and below it, and the number of symbolic links, which are skipped like hidden files."""
    files: list[Path] = []
    links = entries = 0
    for path, folders, names in os.walk(top, onerror=_raise):
        here, found = Path(path), [*folders, *names]
        entries += len(found)
        if entries > MOST_ENTRIES or (found and len(here.relative_to(top).parts) > MOST_DEPTH):
            raise UserFault("home_folder_large", path=str(top))
        linked = {name for name in found if (here / name).is_symlink()}
        links += len(linked)
        kept = sorted(name for name in found if name not in linked and not name.startswith("."))
        files += [here / name for name in kept if (here / name).is_file()]
        folders[:] = [name for name in kept if name in folders]
    return files, links


def _raise(error: OSError) -> NoReturn:
    raise error


def models_in(folder: Path) -> tuple[list[FoundModel], int]:
    """The models in a folder, by path, and how many symbolic links were skipped.

    Raises UserFault ``home_folder_empty``, ``home_folder_large``, ``home_file_unreadable``."""
    with file_faults(UNREADABLE):
        files, links = _files_in(folder)
    found = _models(folder, files)
    if not found:
        raise UserFault("home_folder_empty", path=str(folder))
    if len(found) > MOST_MODELS:
        raise UserFault("home_folder_large", path=str(folder))
    return found, links


def _models(folder: Path, everything: list[Path]) -> list[FoundModel]:
    files = [file for file in everything if file.parent == folder]
    names = {file.name.lower(): file for file in files}
    metadata = names.get(METADATA)
    networks = [file for file in files if has_network_name(file.name)]
    if metadata is not None and len(networks) < 2 and any(is_network(file.name) for file in everything):
        wanted = [file for file in everything if _belongs(file.name)]
        return [FoundModel(folder.resolve().name or "model", wanted, folder)]
    found = []
    for file in files:
        name = file.name.lower()
        if name.endswith(ARCHIVES):
            found.append(FoundModel(_name(file), [file]))
        elif file in networks:
            beside = [names.get(f"{Path(name).stem}.json", metadata), names.get(f"{name}.data")]
            found.append(FoundModel(_name(file), [file, *(one for one in beside if one is not None)]))
    deeper = [file for file in everything if file.parent != folder]
    for name, below in itertools.groupby(deeper, lambda file: file.relative_to(folder).parts[0]):
        found += _models(folder / name, list(below))
    return found


def _belongs(name: str) -> bool:
    """Whether a file is sent with an unpacked model: logs and raw checkpoints are not."""
    return is_network(name) or name.lower().endswith(".json") or is_weights_file(name) or name == "data"


def _name(file: Path) -> str:
    """A model's name: its file's, or its folder's where the file is called ``model``."""
    ending = next((each for each in (*ARCHIVES, *network_suffixes()) if file.name.lower().endswith(each)), "")
    name = file.name[: len(file.name) - len(ending)]
    return (file.parent.resolve().name or name) if name.lower() == "model" else name


def packed(model: FoundModel, to: Path) -> list[Path]:
    """The files of a model as a command takes them: an unpacked one as an archive in the folder ``to``.

    Raises UserFault ``home_folder_large``, ``home_file_unreadable``."""
    if model.unpacked is None:
        return model.files
    archive = to / f"{model.name}.tar"
    with file_faults(UNREADABLE):
        if sum(file.stat().st_size for file in model.files) > DEFAULT_LIMITS.upload_bytes:
            raise UserFault("home_folder_large", path=str(model.unpacked))
        with tarfile.open(archive, "w") as tar:
            for file in model.files:
                tar.add(file, file.relative_to(model.unpacked).as_posix(), recursive=False)
    return [archive]


class _KeptResult(Speaker):
    """Keeps a result for the summary and shows its text at once."""

    value: Any = None

    def result(self, value: Any, text: str) -> None:
        self.value = value
        if not self.as_json:
            super().result(value, text)


class _Row(TypedDict):
    """The outcome of a command for one model: its exit status, and its result or its error."""

    model: str
    status: int
    result: NotRequired[Any]
    error: NotRequired[ErrorDocument]


def of_folder(command: Command, asked: Call, options: argparse.Namespace) -> int:
    """Call a command whose option ``model`` names a folder. Exit status 1: at least one of many models failed."""
    folder = next(Path(name) for name in options.model if Path(name).is_dir())
    if len(options.model) > 1:
        raise UserFault("home_command_line", problem=f"{folder} is a folder, and no other file goes with it")
    found, links = models_in(folder)
    if links:
        asked.speaker.note(f"Symbolic links in {folder} were skipped: {links}.")
    with TemporaryDirectory(prefix="paddock-") as scratch:
        if found[0].unpacked == folder:
            return command(asked, _options(options, found[0], scratch, of_many=False))
        for name in ("name", "trace"):
            if getattr(options, name, ""):
                problem = f"--{name} is for one model; {folder} contains {len(found)}"
                raise UserFault("home_command_line", problem=problem)
        return _each(command, asked, options, scratch, folder, found)


def _options(options: argparse.Namespace, model: FoundModel, scratch: str, of_many: bool) -> argparse.Namespace:
    mine = copy(options)
    mine.model = [str(file) for file in packed(model, Path(scratch))]
    mine.name = getattr(options, "name", "") or model.name[:64]
    mine.of_many = of_many
    return mine


def _each(
    command: Command, asked: Call, options: argparse.Namespace, scratch: str, folder: Path, found: list[FoundModel]
) -> int:
    rows: list[_Row] = []
    final: ErrorDocument | None = None
    for model in found:
        row: _Row = {"model": str((model.unpacked or model.files[0]).relative_to(folder)), "status": 2}
        rows.append(row)
        if final is not None:
            row["error"] = final
            continue
        if not asked.speaker.as_json:
            asked.speaker.note(f"{row['model']}:")
        speaker, mine = _KeptResult(asked.speaker.as_json), copy(asked)
        mine.speaker = speaker
        try:
            row["status"] = command(mine, _options(options, model, scratch, of_many=True))
            row["result"] = speaker.value
        except (PaddockError, SiteRefusal) as fault:
            row["error"] = error_of(fault)
            final = row["error"] if row["error"]["code"] in _FINAL else None
        asked.asked_site = mine.asked_site
    failed = sum(bool(row["status"]) for row in rows)
    value = {"folder": str(folder), "models": rows, "done": len(rows) - failed, "failed": failed}
    lines = table(("model", "outcome"), [(row["model"], _outcome(row)) for row in rows])
    asked.speaker.result(value, f"\n{lines}\n{len(rows)} models: {len(rows) - failed} done, {failed} failed")
    return SOME_FAILED if failed else 0


def _outcome(row: _Row) -> str:
    if "error" in row:
        return f"{row['error']['code']}: {row['error']['message']}"
    return "done" if not row["status"] else "failed"

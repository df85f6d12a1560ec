"""The files that commands read and write on this computer."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from paddock.errors import UserFault
from paddock.packages.kinds import network_suffixes

UNREADABLE, UNWRITABLE = "home_file_unreadable", "home_file_unwritable"


@contextmanager
def file_faults(code: str, path: object = None) -> Iterator[None]:
    """Raise an OSError as UserFault of this code, with ``path`` or else the path that the error names."""
    try:
        yield
    except OSError as error:
        raise UserFault(code, path=str(path or error.filename), problem=error.strerror or str(error)) from error


def free(name: str | Path) -> Path:
    """A place for a file. Raises UserFault("home_exists")."""
    if Path(name).exists():
        raise UserFault("home_exists", path=str(name))
    return Path(name)


def parts_of(names: Sequence[str]) -> dict[str, Path]:
    """The files of a model by the names that the API's upload gives them.

    Raises UserFault("home_command_line") for more than two beside a ``.data`` file."""
    files = [Path(name) for name in names]
    weights = [path for path in files if path.name.endswith(".data")]
    loose = [path for path in files if path not in weights]
    if not loose or len(loose) > 2 or len(weights) > 1:
        raise UserFault("home_command_line", problem="a model is one archive, or a network and its model_metadata.json")
    kind = "model" if loose[0].suffix in network_suffixes() and len(loose) == 2 else "package"
    return dict(zip((kind, "metadata"), loose, strict=False)) | dict(zip(("weights",), weights, strict=False))

"""What pyproject.toml cannot say: the camera's C function is compiled where there is a compiler, and left out
elsewhere, see paddock/simulator/camera/compiled.py."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError

SOURCE = Path("paddock", "simulator", "camera", "compiled.py")

# The package itself cannot be imported where it is built.
spec = importlib.util.spec_from_file_location("compiled", Path(__file__).parent / SOURCE)
compiled = importlib.util.module_from_spec(spec)
spec.loader.exec_module(compiled)


class BuildWarp(build_ext):
    """Our own compiler's flags, and a file name that does not depend on the Python."""

    def get_ext_filename(self, fullname: str) -> str:
        return str(Path(*fullname.split(".")[:-1], compiled.LIBRARY.name))

    def build_extension(self, ext: Extension) -> None:
        library = Path(self.get_ext_fullpath(ext.name))
        library.parent.mkdir(parents=True, exist_ok=True)
        try:
            compiled.build(library)
        except (OSError, RuntimeError) as error:
            raise CompileError(str(error)) from error


setup(
    ext_modules=[Extension("paddock.simulator.camera.warp", [str(SOURCE.with_name("warp.c"))], optional=True)],
    cmdclass={"build_ext": BuildWarp},
)

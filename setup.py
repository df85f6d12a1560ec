"""What pyproject.toml cannot say: the engine's C functions are compiled where there is a compiler, and left out
elsewhere, see paddock/simulator/compiled.py. The same file builds the site and, in a tree that
scripts/package.py puts together, the racers' package."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.errors import CompileError

SIMULATOR = Path("paddock", "simulator")

# The package itself cannot be imported where it is built.
spec = importlib.util.spec_from_file_location("compiled", Path(__file__).parent / SIMULATOR / "compiled.py")
compiled = importlib.util.module_from_spec(spec)
spec.loader.exec_module(compiled)


class BuildNative(build_ext):
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


class AnyPython(bdist_wheel):
    """The wheel is of a system and a processor, and of any Python 3: the C functions know nothing of Python."""

    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", super().get_tag()[2]


class WithStart(build_py):
    """Puts the line for the start of Python, where there is one, beside the package."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            for line in Path(__file__).parent.glob("*.pth"):
                self.copy_file(str(line), str(Path(self.build_lib, line.name)))


sources = [str(SIMULATOR / source.relative_to(compiled.LIBRARY.parent)) for source in compiled.SOURCES]
setup(
    ext_modules=[Extension("paddock.simulator.native", sources, optional=True)],
    cmdclass={"build_ext": BuildNative, "bdist_wheel": AnyPython, "build_py": WithStart},
)

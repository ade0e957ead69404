"""An FMU unpacked into a folder of its own, with its description: everything short of running its native code."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lptn.errors import InputError

from .archive import read_fmu, unpack
from .trust import is_own

REALS = {"Real", "Float64"}


class Unpacked:
    """The files and variables of an FMU.

    Args:
        path: the FMU.
        trust: `True` to accept one that was not exported on this machine.

    Raises:
        InputError: no usable FMU for Co-Simulation, or one that is not trusted.
    """

    def __init__(self, path: Path, trust: bool) -> None:
        self.path = path
        self._folder = tempfile.TemporaryDirectory(prefix="lptn-fmu-", ignore_cleanup_errors=True)
        self.folder = Path(self._folder.name)
        try:
            content = read_fmu(path)
            unpack(content, path, self.folder)
            self.description = self._described()
            if not (trust or is_own(content)):
                found = "an FMU that was not exported on this machine"
                raise InputError(path, "native code", found, "--trust, if you trust where it comes from")
        except BaseException:
            self.close()
            raise
        self.variables = {variable.name: variable for variable in self.description.modelVariables}

    @property
    def fmi(self) -> int:
        """Version of the standard, 2 or 3."""
        return int(self.description.fmiVersion[0])

    @property
    def model_text(self) -> str | None:
        """The model file inside, `None` where there is none.

        Raises:
            InputError: it is no text.
        """
        file = self.folder / "resources" / "model.toml"
        try:
            return file.read_text(encoding="utf-8") if file.is_file() else None
        except (OSError, ValueError) as error:
            raise InputError(self.path, "resources/model.toml", str(error), "a model file, in UTF-8") from error

    def names(self, causality: str) -> list[str]:
        """The real variables of a causality, in order."""
        chosen = self.description.modelVariables
        return [each.name for each in chosen if each.causality == causality and each.type in REALS]

    def references(self, names: Iterable[str], place: str) -> list[int]:
        """Value references of names.

        Raises:
            InputError: a name that is no real variable, said with `place`.
        """
        found = []
        for name in names:
            variable = self.variables.get(name)
            if variable is None or variable.type not in REALS:
                example = next(iter(self.variables))
                raise InputError(self.path, place, f'"{name}"', f"a variable of the FMU, such as {example}")
            found.append(variable.valueReference)
        return found

    def check_binary(self, fmpy: Any) -> None:
        """Refuse an FMU without a library for this machine.

        Raises:
            InputError: there is none.
        """
        place = fmpy.platform if self.fmi == 2 else fmpy.platform_tuple
        if not (self.folder / "binaries" / place).is_dir():
            expected = "an FMU with this machine among its --platforms"
            raise InputError(self.path, "binaries", f"none for {place}", expected)

    def close(self) -> None:
        """Remove the files."""
        self._folder.cleanup()

    def _described(self) -> Any:
        try:
            described = import_fmpy().read_model_description(str(self.folder), validate=False)
        except InputError:
            raise
        except Exception as error:  # fmpy and lxml raise many kinds
            raise InputError(self.path, "modelDescription.xml", str(error)[:200], "FMI 2.0 or 3.0") from error
        if described.coSimulation is None or described.fmiVersion.partition(".")[0] not in ("2", "3"):
            found = f"FMI {described.fmiVersion}, Co-Simulation: {described.coSimulation is not None}"
            raise InputError(self.path, "modelDescription.xml", found, "FMI 2.0 or 3.0 for Co-Simulation")
        return described


def import_fmpy() -> Any:
    """The package `fmpy` with its two FMI modules.

    Raises:
        InputError: it is not there.
    """
    try:
        import fmpy
        import fmpy.fmi2
        import fmpy.fmi3
    except ModuleNotFoundError as error:
        raise InputError("fmpy", "package", "not installed", "pip install 'lptn[fmu]'") from error
    return fmpy

"""An FMU opened: unpacked into a folder of its own and described, everything short of running its native code.

Nothing in the archive may lead outside its folder, fill the disk or trick the XML reader.
"""

from __future__ import annotations

import copy
import io
import itertools
import lzma
import math
import re
import shutil
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

from lptn.basics.bounds import DESCRIPTION, Bound
from lptn.basics.errors import InputError
from lptn.basics.files import bytes_of, text_of

from .library import fault
from .trust import is_own
from .variables import BASES, UnitDefinition

ARCHIVE = Bound(1 << 30, "bytes")
"""Of an archive, packed and unpacked: FMUs with libraries of several machines have 100 MB."""
MEMBERS = Bound(10_000, "files")
"""Of an archive: FMUs with their sources and documentation have some hundred."""
VARIABLES = Bound(100_000, "variables")
"""Of an FMU, elements of arrays counted: an importer needs some 10 µs and 1 kB for each."""
REALS = {"Real", "Float64"}
_IDENTIFIER = re.compile(rb"""modelIdentifier\s*=\s*(["'])(.*?)\1""")
_BEGINNING = re.compile(rb"\s*(?:<\?xml\b([^>]*)\?>|<[A-Za-z!])")
_ENCODING = re.compile(rb"""encoding\s*=\s*["']([^"']*)["']""")
_PLAIN = (b"utf-8", b"us-ascii", b"ascii", b"iso-8859-1", b"windows-1252")
_C_NAME = re.compile(rb"[A-Za-z_][A-Za-z0-9_]*")
_DAMAGED = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError, RuntimeError, ValueError)
"""What `zipfile` raises for archives that are none."""
_EXPECTED = "an FMU: a ZIP archive of plain files with modelDescription.xml"


@dataclass(frozen=True)
class Access:
    """Variables that are got or set in one call.

    Args:
        references: of the variables, arrays once.
        size: how many values they have.
        places: of the values that were asked for; `None` where these are all, in order.
    """

    references: tuple[int, ...]
    size: int
    places: Sequence[int] | None


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
            content = bytes_of(path, ARCHIVE, _EXPECTED)  # once, so that what is checked is what runs
            unpack(content, path, self.folder)
            self.description = self._described()
            self._check_sizes()
            if not (trust or is_own(content)):
                foreign = "an FMU that was not exported on this machine"
                raise InputError(path, "native code", foreign, "--trust, if you trust where it comes from")
        except BaseException:
            self.close()
            raise
        self._slots: dict[str, tuple[int, int, int]] = {}  # reference, place in the array and its size, by name
        self.variables = {
            element.name: element
            for variable in self.description.modelVariables
            for element in self._elements(variable)
        }

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
            return text_of(file, "a model file") if file.is_file() else None
        except InputError as error:
            raise InputError(self.path, "resources/model.toml", error.found, error.expected) from error

    def names(self, causality: str) -> list[str]:
        """The real variables of a causality, in order."""
        every = self.variables.values()
        return [variable.name for variable in every if variable.causality == causality and variable.type in REALS]

    @cached_property
    def units(self) -> dict[str, UnitDefinition]:
        """The units that the FMU defines, by name; kelvin is known without.

        Raises:
            InputError: a unit with a factor of 0, or of no number.
        """
        definitions = {"K": UnitDefinition("K", {"K": 1})}
        for unit in self.description.unitDefinitions:
            if (base := unit.baseUnit) is not None:
                powers = {name: int(getattr(base, name) or 0) for name in BASES}
                exponents = {name: power for name, power in powers.items() if power}
                factor, offset = float(base.factor), float(base.offset)
                if not 0 < abs(factor) < math.inf:
                    place, found = f"modelDescription.xml, unit {unit.name}", f"a factor of {factor:g}"
                    raise InputError(self.path, place, found, "a unit that can be turned into others")
                definitions[unit.name] = UnitDefinition(unit.name, exponents, factor, offset)
        return definitions

    def unit(self, name: str) -> UnitDefinition | None:
        """The unit of a variable; `None` where it is not defined."""
        return self.units.get(unit_of(self.variables[name]) or "")

    def _check_sizes(self) -> None:
        """Refuse more variables than a table of them can hold, counted before any array is taken apart."""
        found = 0
        for variable in self.description.modelVariables:
            shape = [1 if length is None else length for length in variable.shape or ()]
            if any(length < 0 for length in shape):
                problem = f"a dimension of {min(shape)}"
                raise InputError(self.path, f"modelDescription.xml, {variable.name}", problem, "one of 0 or more")
            found += math.prod(shape)
        VARIABLES.check(found, self.path, "modelDescription.xml")

    def _elements(self, variable: Any) -> list[Any]:
        """fmpy's description of a variable, or of each element of an array.

        Elements are called as the place's own variable would be where the FMU says the places, else `name[1,2]`.
        """
        shape = tuple(variable.shape or ())
        size = math.prod(shape)
        if not shape:
            self._slots[variable.name] = (variable.valueReference, 0, 1)
            return [variable]
        starts = variable.start.split() if isinstance(variable.start, str) else variable.start or ()
        places, elements = self._places.get(variable.name, ()), []
        for number, index in enumerate(itertools.product(*(range(1, length + 1) for length in shape))):
            element = copy.copy(variable)
            element.name = f"{variable.name}[{','.join(map(str, index))}]"
            if len(places) == size:
                inner = variable.name.removeprefix("der(").removesuffix(")")
                element.name = variable.name.replace(inner, f"{places[number]}.{inner}")
            element.start = starts[number] if len(starts) == size else starts[0] if starts else None
            self._slots[element.name] = (variable.valueReference, number, size)
            elements.append(element)
        return elements

    @cached_property
    def _places(self) -> dict[str, list[str]]:
        """The places that an array's elements belong to, by its name, where the FMU says them."""
        root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        result = {}
        for variable in root.iterfind("ModelVariables/*"):
            places = variable.iterfind("Annotations/Annotation[@type='lptn.places']/Place")
            result[variable.get("name", "")] = [place.get("name", "") for place in places]
        return result

    def access(self, names: Iterable[str], place: str) -> Access:
        """How variables are got and set by their names.

        Raises:
            InputError: a name that is no real variable, said with `place`.
        """
        begins: dict[int, int] = {}
        references: list[int] = []
        places: list[int] = []
        size = 0
        for name in names:
            variable = self.variables.get(name)
            if variable is None or variable.type not in REALS:
                example = next(iter(self.variables))
                raise InputError(self.path, place, f'"{name}"', f"a variable of the FMU, such as {example}")
            reference, index, length = self._slots[name]
            if reference not in begins or length == 1:
                begins[reference] = size
                size += length
                references.append(reference)
            places.append(begins[reference] + index)
        return Access(tuple(references), size, None if places == list(range(size)) else places)

    def check_binary(self, fmpy: Any) -> None:
        """Refuse an FMU without a whole library for this machine.

        Raises:
            InputError: there is none, or it was cut off.
        """
        platform = fmpy.platform if self.fmi == 2 else fmpy.platform_tuple
        folder = self.folder / "binaries" / platform
        if not folder.is_dir():
            expected = "an FMU with this machine among its --platforms"
            raise InputError(self.path, "binaries", f"none for {platform}", expected)
        library = folder / f"{self.description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
        wrong = fault(library) if library.is_file() else "not there"
        if wrong:
            raise InputError(self.path, f"binaries/{platform}/{library.name}", wrong, "a library that loads")

    def close(self) -> None:
        """Remove the files."""
        self._folder.cleanup()

    def _described(self) -> Any:
        fmpy = import_fmpy()
        try:
            description = fmpy.read_model_description(str(self.folder), validate=False)
        except Exception as error:  # fmpy and lxml raise many kinds
            raise InputError(self.path, "modelDescription.xml", str(error)[:200], "FMI 2.0 or 3.0") from error
        if description.coSimulation is None or description.fmiVersion.partition(".")[0] not in ("2", "3"):
            version = f"FMI {description.fmiVersion}, Co-Simulation: {description.coSimulation is not None}"
            raise InputError(self.path, "modelDescription.xml", version, "FMI 2.0 or 3.0 for Co-Simulation")
        return description


def unit_of(variable: Any) -> str | None:
    """The unit of fmpy's description of a variable, its declared type's where it has none of its own."""
    declared = variable.declaredType
    return variable.unit or (declared.unit if declared is not None else None)


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


def unpack(content: bytes, path: Path, folder: Path) -> None:
    """Unpack an FMU into an empty folder.

    Args:
        content: the FMU's bytes.
        path: what the FMU is called, for messages.
        folder: where to.

    Raises:
        InputError: see `unpack_files`; or no model description, or one with entities.
    """
    unpack_files(content, path, folder)
    _check_description(folder / "modelDescription.xml", path)


def unpacked_size(path: Path) -> int:
    """How many bytes an archive holds, as its directory says; 0 of what is none, which is refused later."""
    if not path.is_file():  # a pipe would be waited for
        return 0
    try:
        with zipfile.ZipFile(path) as archive:
            return sum(entry.file_size for entry in archive.infolist())
    except _DAMAGED:
        return 0


def unpack_files(content: bytes, path: Path, folder: Path) -> None:
    """Unpack a ZIP archive, an FMU or a system of them, into an empty folder.

    Raises:
        InputError: no ZIP archive, a path that leads outside, a link, a name twice, too much inside.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
            _check_names(entries, path)
            for entry in entries:
                if not entry.is_dir():
                    target = folder / entry.filename
                    target.parent.mkdir(parents=True, exist_ok=True)
                    # Of the size at most that its header claims: `zipfile` reads no further.
                    with archive.open(entry) as stream, target.open("xb") as output:
                        shutil.copyfileobj(stream, output)
    except InputError:
        raise
    except _DAMAGED as error:
        raise InputError(path, "archive", str(error) or "a damaged archive", _EXPECTED) from error


def _check_names(entries: list[zipfile.ZipInfo], path: Path) -> None:
    MEMBERS.check(len(entries), path, "archive")
    ARCHIVE.check(sum(entry.file_size for entry in entries), path, "archive, unpacked")
    seen: set[str] = set()
    for entry in entries:
        name = entry.orig_filename
        parts = PurePosixPath(name).parts
        if "\\" in name or ":" in name or "\0" in name or name.startswith("/") or ".." in parts or not parts:
            raise InputError(path, "archive", f"the path {name!r}", "paths inside the FMU, with forward slashes")
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise InputError(path, "archive", f"the link {name!r}", "plain files")
        folded = name.rstrip("/").casefold()
        if folded in seen:
            raise InputError(path, "archive", f"{name!r} twice", "each file once")
        seen.add(folded)


def _check_description(file: Path, path: Path) -> None:
    if not file.is_file():
        raise InputError(path, "archive", "no modelDescription.xml", _EXPECTED)
    DESCRIPTION.check(file.stat().st_size, path, "modelDescription.xml")
    text = file.read_bytes()
    # An encoding in which `<!DOCTYPE` looks otherwise would get past the next check.
    beginning = _BEGINNING.match(text.removeprefix(b"\xef\xbb\xbf"))
    encodings = _ENCODING.findall(beginning[1] or b"") if beginning else [b"none"]
    if any(encoding.lower() not in _PLAIN for encoding in encodings) or b"\0" in text:
        raise InputError(path, "modelDescription.xml", "another encoding", "XML in UTF-8")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError(path, "modelDescription.xml", "a document type or entities", "plain XML")
    for _, name in _IDENTIFIER.findall(text):
        if not _C_NAME.fullmatch(name):
            raise InputError(path, "modelDescription.xml", f"the model identifier {name!r}", "a C identifier")

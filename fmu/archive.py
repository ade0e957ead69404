"""An FMU unpacked: nothing in the archive may lead outside its folder, fill the disk or trick the XML reader."""

from __future__ import annotations

import io
import lzma
import re
import stat
import struct
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from lptn.errors import InputError

_MOST_FILES = 10_000
_MOST_BYTES = 1 << 30
_CHUNK = 1 << 20
_IDENTIFIER = re.compile(rb"""modelIdentifier\s*=\s*(["'])(.*?)\1""")
_BEGINNING = re.compile(rb"\s*(?:<\?xml\b([^>]*)\?>|<[A-Za-z!])")
_ENCODING = re.compile(rb"""encoding\s*=\s*["']([^"']*)["']""")
_PLAIN = (b"utf-8", b"us-ascii", b"ascii", b"iso-8859-1", b"windows-1252")
_C_NAME = re.compile(rb"[A-Za-z_][A-Za-z0-9_]*")
_DAMAGED = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError, RuntimeError, ValueError)
"""What `zipfile` raises for archives that are none."""
_EXPECTED = "an FMU: a ZIP archive of plain files with modelDescription.xml"


def read_fmu(path: Path) -> bytes:
    """The bytes of an FMU: one reading, so that what is checked is what runs.

    Raises:
        InputError: the file can't be read or is too large.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(path, "file", "more than 1 GB", _EXPECTED)
        return path.read_bytes()
    except OSError as error:
        raise InputError(path, "file", error.strerror or str(error), _EXPECTED) from error


def unpack(content: bytes, path: Path, folder: Path) -> None:
    """Unpack an FMU into an empty folder.

    Args:
        content: the FMU's bytes.
        path: what the FMU is called, for messages.
        folder: where to.

    Raises:
        InputError: no ZIP archive, a path that leads outside, a link, a name twice, too much inside, XML with entities.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
            _check_names(entries, path)
            left = _MOST_BYTES
            for entry in entries:
                if not entry.is_dir():
                    left = _write(archive, entry, path, folder, left)
    except InputError:
        raise
    except _DAMAGED as error:
        raise InputError(path, "archive", str(error) or "a damaged archive", _EXPECTED) from error
    _check_description(folder / "modelDescription.xml", path)


def _check_names(entries: list[zipfile.ZipInfo], path: Path) -> None:
    if len(entries) > _MOST_FILES:
        raise InputError(path, "archive", f"{len(entries)} files", f"at most {_MOST_FILES}")
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


def _write(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path, folder: Path, left: int) -> int:
    """Unpack one file; what its header claims is not believed. Returns how many bytes may still come."""
    target = folder / entry.filename
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(entry) as stream, target.open("xb") as output:
        while chunk := stream.read(_CHUNK):
            left -= len(chunk)
            if left < 0:
                raise InputError(path, "archive", "more than 1 GB unpacked", _EXPECTED)
            output.write(chunk)
    return left


def _check_description(file: Path, path: Path) -> None:
    if not file.is_file():
        raise InputError(path, "archive", "no modelDescription.xml", _EXPECTED)
    text = file.read_bytes()
    # An encoding in which `<!DOCTYPE` looks otherwise would get past the next check.
    begun = _BEGINNING.match(text.removeprefix(b"\xef\xbb\xbf"))
    encodings = _ENCODING.findall(begun[1] or b"") if begun else [b"none"]
    if any(encoding.lower() not in _PLAIN for encoding in encodings) or b"\0" in text:
        raise InputError(path, "modelDescription.xml", "another encoding", "XML in UTF-8")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise InputError(path, "modelDescription.xml", "a document type or entities", "plain XML")
    for _, name in _IDENTIFIER.findall(text):
        if not _C_NAME.fullmatch(name):
            raise InputError(path, "modelDescription.xml", f"the model identifier {name!r}", "a C identifier")

"""Nothing in a file is ever run, and nothing is written but where the user said: an audit of the code, and tricks."""

from __future__ import annotations

import ast
import io
import multiprocessing
import pickle
import stat
import struct
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.fmu import trust
from lptn.fmu.archive import unpack
from lptn.robots.presets import presets
from tests.hardening.bad_inputs import table

ROOT = Path(__file__).parents[2]
SOURCES = sorted(path for room in ("src/lptn", "fmu", "planners") for path in (ROOT / room).rglob("*.py"))
RUNS_TEXT = {"eval", "exec", "compile", "__import__", "execfile"}
RUNS_DATA = {"cPickle", "dill", "cloudpickle", "marshal", "shelve", "joblib", "yaml", "sympy", "jsonpickle"}
RUNS_ITS_OWN = {"src/lptn/batch/module.py"}
"""What runs its own text: the module that `lptn export` writes, names in it as Python quotes them."""
UNPICKLES = {
    "src/lptn/fleet/work.py",  # what the parent process sent, as any pool of processes does
    "src/lptn/live/assessment.py",  # what a process and its child tell each other
    "src/lptn/workbench/calculation.py",  # a session's study, from a folder that this user alone can write to
}
MAKES = {
    "write_text", "write_bytes", "savefig", "to_excel", "savez", "savez_compressed", "savetxt", "tofile", "to_pickle",
    "ParquetWriter", "symlink_to", "hardlink_to", "extractall", "copyfile", "copytree",
}  # fmt: skip
"""Calls that make a file; so do `to_csv` and `to_parquet` with something to write to, and `open` not to read."""
MADE = {
    "src/lptn/basics/files.py": {"open"},  # where a user's file is written: whole or not at all
    "src/lptn/basics/c_library.py": {"write_text", "write_bytes"},  # in a folder that is removed again
    "src/lptn/basics/style.py": {"savefig"},  # these into memory, for `write_whole`
    "src/lptn/basics/tables.py": {"to_parquet"},
    "src/lptn/cli/options.py": {"savefig"},
    "src/lptn/cli/terminal.py": {"open"},  # /dev/null
    "src/lptn/live/assessment.py": {"open"},  # its standard output
    "src/lptn/live/sinks.py": {"open"},  # lines that are added as they come
    "src/lptn/live/watch.py": {"savez"},  # into memory, for `write_whole`
    "src/lptn/virtual/writers.py": {"open", "to_csv", "to_parquet"},  # logs, renamed when they are whole
    "fmu/compile.py": {"write_bytes"},  # in a folder that is removed again
    "fmu/archive.py": {"open"},  # an FMU unpacked, checked below
    "fmu/reference/make.py": {"write_bytes", "write_text"},  # of the developers, not in the package
}


@cache
def _nodes(path: Path) -> list[ast.AST]:
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def _calls(path: Path) -> Iterator[ast.Call]:
    yield from (node for node in _nodes(path) if isinstance(node, ast.Call))


def _name(call: ast.Call) -> str:
    function = call.func
    return (
        function.attr if isinstance(function, ast.Attribute) else function.id if isinstance(function, ast.Name) else ""
    )


def _risks(path: Path) -> Iterator[str]:
    """What in a module could run what a file holds."""
    for node in _nodes(path):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            yield from {name.partition(".")[0] for name in names} & RUNS_DATA
    for call in _calls(path):
        text, name = ast.unparse(call.func), _name(call)
        given = {word.arg: ast.unparse(word.value) for word in call.keywords}
        unpickles = name in ("load", "loads", "Unpickler") and text.startswith("pickle")
        if (
            (text in RUNS_TEXT and str(path.relative_to(ROOT)) not in RUNS_ITS_OWN)
            or name in ("system", "popen", "read_pickle")
            or (unpickles and str(path.relative_to(ROOT)) not in UNPICKLES)
            or ("shell" in given and text.startswith("subprocess"))
            or given.get("allow_pickle", "False") != "False"
        ):
            yield ast.unparse(call)


@pytest.mark.long
def test_no_module_runs_text_or_unpickles() -> None:
    assert {str(path): risks for path in SOURCES if (risks := list(_risks(path)))} == {}


def _made(path: Path) -> set[str]:
    names = set()
    for call in _calls(path):
        name = _name(call)
        writes_to = name in ("to_csv", "to_parquet") and bool(call.args)
        values = [*call.args, *(word.value for word in call.keywords)]
        modes = [
            constant.value
            for constant in values
            if isinstance(constant, ast.Constant) and isinstance(constant.value, str)
        ]
        opens = name in ("open", "fdopen") and any(set(mode) & set("wxa+") for mode in modes if len(mode) <= 3)
        if name in MAKES or writes_to or opens:
            names.add("open" if opens else name)
    return names


def test_files_are_made_only_where_they_come_whole() -> None:
    assert {str(path.relative_to(ROOT)): made for path in SOURCES if (made := _made(path))} == MADE


# --- tricks ---------------------------------------------------------------------------------------


class _Payload:
    """What would leave a file behind if anybody unpickled it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[Path]]:
        return Path.touch, (self.path,)


def _run(*words: object) -> int:
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    return int(stop.value.code or 0)


def test_pickles_inside_a_parquet_file_are_not_unpickled(tmp_path: Path) -> None:
    touched, log, model = tmp_path / "touched", tmp_path / "log.parquet", tmp_path / "model.toml"
    payload = pickle.dumps(_Payload(touched))
    pickle.loads(payload)
    assert touched.exists()
    touched.unlink()
    trap = {b"ARROW:extension:name": b"arrow.py_extension_type", b"ARROW:extension:metadata": payload}
    frame = table()
    fields = [pa.field(name, pa.float64(), metadata=trap) for name in frame]
    extra = pa.field("object", pa.binary(), metadata=trap)
    columns = [*(pa.array(frame[name].astype(float)) for name in frame), pa.array([payload] * len(frame))]
    written = pa.table(columns, schema=pa.schema([*fields, extra], metadata={b"pandas": b"{}", b"PICKLE": payload}))
    pq.write_table(written, log)
    model.write_text(presets()["single-motor"])
    assert _run("compare", model, log) == 0
    assert not touched.exists()


HOSTILE = "$(touch touched)`touch touched`__import__('os').mknod('touched');{{7*7}}<script>alert(1)</script>%n"


def test_words_in_a_model_stay_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(presets()["single-motor"].replace('"single motor"', f'"{HOSTILE}"'))
    table().assign(extra=HOSTILE).to_csv("log;touch touched.csv", index=False)
    words = ("compare", "model.toml", "log;touch touched.csv", "--report", "page.html", "--json", "found.json")
    assert _run(*words) == 0
    page = Path("page.html").read_text()
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page
    assert "49" not in page[page.index("&lt;script") - 100 : page.index("&lt;script")]
    assert not Path("touched").exists()


def test_a_formula_in_a_log_is_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, model = tmp_path / "log.csv", tmp_path / "model.toml"
    model.write_text(presets()["single-motor"])
    frame = table().astype(object)
    frame["torque.motor"] = "=cmd|' /C touch touched'!A0"
    frame.to_csv(log, index=False)
    assert _run("compare", model, log) == 2
    assert "a number" in capsys.readouterr().err


# --- FMUs -----------------------------------------------------------------------------------------

XML = b'<fmiModelDescription fmiVersion="3.0"/>'


def _zipped(*entries: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return stream.getvalue()


def _special(name: str, mode: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.create_system = 3
    info.external_attr = mode << 16
    return info


def _lying_size() -> bytes:
    """The directory says one byte; the data are a megabyte."""
    content = bytearray(_zipped(("modelDescription.xml", XML), ("zeros", bytes(1 << 20))))
    at = content.rindex(b"PK\x01\x02")
    content[at + 24 : at + 28] = struct.pack("<I", 1)
    return bytes(content)


def _encrypted() -> bytes:
    content = bytearray(_zipped(("modelDescription.xml", XML)))
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(mark) + offset] |= 1
    return bytes(content)


def _overlapping() -> bytes:
    """Many names for one piece of data: a bomb that needs no nesting."""
    name = "zeros0000"
    content = _zipped((name, bytes(1 << 22)))
    head, tail = content[: content.index(b"PK\x01\x02")], content[content.index(b"PK\x01\x02") :]
    entry, end = tail[: 46 + len(name)], tail[46 + len(name) :]
    entries = b"".join(entry.replace(name.encode(), f"zeros{k:04}".encode()) for k in range(400))
    end = end[:8] + struct.pack("<HHI", 400, 400, len(entries)) + end[16:]
    return head + entries + end


TRICKS: dict[str, Callable[[], bytes]] = {
    "a file where a folder is needed": lambda: _zipped(("a", b"x"), ("a/b", b"x"), ("modelDescription.xml", XML)),
    "through its own folder": lambda: _zipped(("a/../../outside", b"x"), ("modelDescription.xml", XML)),
    "a folder that is a link": lambda: _zipped(
        (_special("a/", stat.S_IFLNK | 0o777), b""), ("modelDescription.xml", XML)
    ),
    "more files than any FMU": lambda: _zipped(*((f"f{k}", b"") for k in range(10_001)), method=zipfile.ZIP_STORED),
    "a size that lies": _lying_size,
    "encrypted": _encrypted,
    "entries that overlap": _overlapping,
    "the network's share": lambda: _zipped(("\\\\host\\share", b"x"), ("modelDescription.xml", XML)),
    "a stream of a file": lambda: _zipped(("modelDescription.xml:x", b"x"), ("modelDescription.xml", XML)),
    "only a folder of that name": lambda: _zipped(("modelDescription.xml/", b"")),
    "cut off": lambda: _zipped(("modelDescription.xml", XML))[:-30],
    "names to the limit": lambda: _zipped(("a/" * 3000 + "b", b"x"), ("modelDescription.xml", XML)),
    "a name that is too long": lambda: _zipped(("n" * 300, b"x"), ("modelDescription.xml", XML)),
}


@pytest.mark.parametrize("trick", TRICKS)
def test_an_archive_with_a_trick_is_refused_and_nothing_leaves_its_folder(
    trick: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lptn.fmu.archive.ARCHIVE", Bound(1 << 26, "bytes"))
    folder = tmp_path / "inside"
    folder.mkdir()
    with pytest.raises(InputError) as refused:
        unpack(TRICKS[trick](), tmp_path / "x.fmu", folder)
    assert str(refused.value).isprintable()
    assert list(tmp_path.iterdir()) == [folder]


def test_devices_and_modes_in_an_archive_become_plain_files(tmp_path: Path) -> None:
    special = [_special("pipe", stat.S_IFIFO | 0o777), _special("device", stat.S_IFCHR | 0o777)]
    special.append(_special("root", stat.S_IFREG | stat.S_ISUID | 0o4777))
    unpack(
        _zipped(*((member, b"x") for member in special), ("modelDescription.xml", XML)), tmp_path / "x.fmu", tmp_path
    )
    for path in tmp_path.iterdir():
        assert stat.S_ISREG(path.lstat().st_mode)
        assert not path.stat().st_mode & (stat.S_ISUID | 0o111)


def _remember(numbers: range) -> None:
    for number in numbers:
        trust.remember(str(number).encode())


def test_processes_that_export_at_once_lose_nobodys_trust(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    context = multiprocessing.get_context("fork")
    jobs = [context.Process(target=_remember, args=(range(start, 200, 4),)) for start in range(4)]
    for job in jobs:
        job.start()
    for job in jobs:
        job.join()
    assert all(trust.is_own(str(number).encode()) for number in range(200))
    assert not trust.is_own(b"200")
    assert not trust.is_own(b"19 ")
    assert (tmp_path / "lptn" / "own_fmus").stat().st_mode & 0o077 == 0


def test_the_oldest_trust_is_forgotten_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(trust, "_MOST", 3)
    _remember(range(6))
    assert Counter(trust.is_own(str(number).encode()) for number in range(6)) == {True: 3, False: 3}
    assert trust.is_own(b"5")


def test_without_a_home_nothing_is_trusted_and_nothing_breaks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    trust.remember(b"x")
    assert not trust.is_own(b"x")

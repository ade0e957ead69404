"""FMUs for the fuzzer, read up to the point at which their native code would run."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from random import Random

from lptn.basics.errors import InputError
from lptn.robots.presets import presets


@cache
def fmus() -> Mapping[str, bytes]:
    """The leg as an FMU of either version, sources alone: what the fuzzer spoils is never run."""
    from lptn.fmu import export
    from lptn.model.file import read_model_file

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "leg.toml").write_text(presets()["leg"])
        model = read_model_file(folder / "leg.toml")
        made = [export(model, folder / f"leg{fmi}.fmu", fmi=fmi, platforms=()) for fmi in (2, 3)]
        return {exported.path.name: exported.path.read_bytes() for exported in made}


def read_fmu(path: Path, _: Random) -> None:
    """An FMU up to the point at which its native code would run."""
    from lptn.fmu.archive import Unpacked, import_fmpy
    from lptn.model.file import parse_model

    unpacked = Unpacked(path, trust=True)
    try:
        text = unpacked.model_text
        if text is not None:
            parse_model(text, path / "resources" / "model.toml")
        for causality in ("input", "output", "parameter"):
            unpacked.access(unpacked.names(causality), causality)
        with contextlib.suppress(InputError):
            unpacked.check_binary(import_fmpy())
    finally:
        unpacked.close()

"""What a command imports before it answers: heavy packages only where it uses them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

TCLAB = Path(__file__).parents[2] / "examples" / "tclab"
MODEL, LOG = str(TCLAB / "two_heaters.toml"), str(TCLAB / "log.csv")

NUMERIC = {"numpy", "casadi"}
READERS = {"pandas", "pyarrow", "pydantic", "tomlkit", "pint"}
SEARCH = {"scipy.optimize", "scipy.stats", "scipy.linalg", "matplotlib", "pint", "pyarrow.parquet", "dask"}
_SCRIPT = """
import json, sys
from lptn.cli.main import main
try:
    main(json.loads(sys.argv[1]))
finally:
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


def _imported(*words: str) -> set[str]:
    """The modules that a process has imported when its command ends, however it ends."""
    command = [sys.executable, "-c", _SCRIPT, json.dumps(words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return set(json.loads(done.stderr.splitlines()[-1]))


@pytest.mark.parametrize(
    ("words", "unwanted"),
    [
        (["--help"], NUMERIC | READERS | SEARCH),
        (["fit", "--nonsense"], NUMERIC | READERS | SEARCH),
        (["fit", "absent.toml", "absent.csv"], NUMERIC | READERS | SEARCH),
        (["improve", MODEL, "absent.csv"], NUMERIC | READERS | SEARCH),
        (["check", MODEL, "absent.csv"], NUMERIC | READERS | SEARCH),
        (["new", "leg"], NUMERIC | READERS | SEARCH),
        (["effects"], READERS | SEARCH),
        (["new"], NUMERIC | READERS | SEARCH),
        pytest.param(["check", MODEL, LOG], SEARCH, marks=pytest.mark.long),
        pytest.param(["compare", MODEL, LOG], SEARCH, marks=pytest.mark.long),
    ],
    ids=lambda value: " ".join(Path(word).name for word in value) if isinstance(value, list) else "",
)
def test_a_command_imports_heavy_packages_only_where_it_uses_them(words: list[str], unwanted: set[str]) -> None:
    assert not _imported(*words) & unwanted

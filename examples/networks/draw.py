# %% [markdown]
# # Every network that is shipped, drawn from its model file
#
# One function draws them, `lptn.report.draw_network`, which reports, the workbench and `lptn check --drawing` use.
#
# `python examples/networks/draw.py` writes the drawings and the page beside this script, `-o FOLDER` elsewhere.

# %%
from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path

from lptn.basics.files import write_whole
from lptn.model.file import ModelFile, parse_model
from lptn.report import draw_network

HERE = Path(__file__).parent
EXAMPLES = HERE.parent

# What a source shows as a figure, or describes, and the model file that has it.
OF_SOURCES = {
    "quadruped": "[QuadrupedLPTN], from its text: joints, couplings, the onboard computer",
    "u8": "[Chen2017, fig. 3-1], winding, stator and housing",
    "u8-heat-sink": "[Chen2017, chapter 4], the exchanger on the stator",
    "one_node (u8_thesis)": "[Chen2017, fig. 3-3], one node",
    "one_node (heated_block)": "[BlockLPTN, fig. 2], all the heat in one point",
    "half_the_heat": "[BlockLPTN, sec. 2.1], half of it",
    "heated-block": "[BlockLPTN, fig. 6], exact: its resistance -L/(6kA) lies inside the body",
    "three_nodes": "[BlockLPTN, sec. 2.3], more nodes",
}


# %%
def models() -> Iterator[tuple[str, str, ModelFile]]:
    """Of each shipped model its name, where its file is, seen from here, and the file: ready models, then examples'."""
    robots = files("lptn.robots")
    for ready in sorted(entry.name for entry in robots.iterdir() if entry.name.endswith(".toml")):
        text = robots.joinpath(ready).read_text(encoding="utf-8")
        yield ready.removesuffix(".toml"), f"../../src/lptn/robots/{ready}", parse_model(text, Path(ready))
    paths = [path for path in sorted(EXAMPLES.glob("*/*.toml")) if "[nodes" in path.read_text(encoding="utf-8")]
    for path in paths:
        twice = sum(other.stem == path.stem for other in paths) > 1
        name = f"{path.stem} ({path.parent.name})" if twice else path.stem
        yield name, f"../{path.parent.name}/{path.name}", parse_model(path.read_text(encoding="utf-8"), path)


def picture(name: str) -> str:
    """The file of a drawing."""
    return name.replace(" (", "-").replace(")", "") + ".svg"


def page() -> str:
    """The drawings on a page of Markdown."""
    lines = [
        "# The networks",
        "",
        "Every model file that is shipped, drawn by the one function `lptn.report.draw_network`, which reports, the",
        "workbench and `lptn check MODEL --drawing FILE.svg` use. `python examples/networks/draw.py` made it.",
        "A box is a node, a line a thermal resistance, a short line with a bar one to the surroundings; numbers name",
        "the effects that act there.",
    ]
    for name, place, file in models():
        source = f" {OF_SOURCES[name]}." if name in OF_SOURCES else ""
        nodes, links = len(file.network.dynamic), len(file.network.resistors) + len(file.network.conductors)
        counts = f"{nodes} node{'s' * (nodes != 1)}, {links} link{'s' * (links != 1)}."
        lines += ["", f"## {name}", "", f"[{place.rpartition('/')[2]}]({place}): {counts}{source}", ""]
        lines += [f"![Network of {name}: {', '.join(file.network.dynamic)}]({picture(name)})"]
    return "\n".join(lines) + "\n"


# %%
def main(words: Sequence[str] | None = None) -> None:
    """Write all drawings and the page."""
    parser = argparse.ArgumentParser(description="Draw every network that is shipped.")
    parser.add_argument("-o", "--output", type=Path, default=HERE, help="folder to write into")
    folder = parser.parse_args(words).output
    folder.mkdir(parents=True, exist_ok=True)
    for name, _, file in models():
        write_whole(folder / picture(name), draw_network(file.network))
    write_whole(folder / "README.md", page())


if __name__ == "__main__":
    main()

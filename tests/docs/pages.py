"""The project's pages of Markdown: their code blocks, links and headings."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
_FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)


@dataclass(frozen=True)
class Page:
    """One page.

    Args:
        name: its path from the root of the project.
        text: what stands in it.
    """

    name: str
    text: str

    @property
    def folder(self) -> Path:
        """Where its links begin."""
        return (ROOT / self.name).parent

    def blocks(self, language: str) -> list[str]:
        """Its code blocks of one language; the empty one is the shell's."""
        return [body for kind, body in _FENCE.findall(self.text) if kind == language]

    def links(self) -> list[str]:
        """Where its links go; what stands in code is none."""
        return _LINK.findall(re.sub(r"`[^`\n]*`", "", _FENCE.sub("", self.text)))

    def anchors(self) -> set[str]:
        """The anchors that GitHub makes of its headings."""
        plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in _HEADING.findall(_FENCE.sub("", self.text)))
        return {heading.replace(" ", "-") for heading in plain}


def pages() -> list[Page]:
    """Every page that is in the project, or about to be."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]
    names = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    if not names:
        raise RuntimeError("no page found")
    return [Page(name, (ROOT / name).read_text(encoding="utf-8")) for name in names if (ROOT / name).is_file()]

"""The typed sentence: every answer is a few of them, and terminal, page, notebook and report show the same ones."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Literal

Label = Literal[
    "Verdict", "Findings", "Best candidates", "Structure", "Added by hand", "Error", "Largest error", "Worst place",
    "Fit", "Not fitted", "Warning", "Unexplained heat", "Load", "Uncertainty", "Sensors ignored", "Model", "Losses",
    "Sensors", "Excitation", "Effects", "Written", "Next",
]  # fmt: skip


@dataclass(frozen=True)
class Sentence:
    """What is said under one label, a sentence or two."""

    label: Label
    text: str

    def __str__(self) -> str:
        return f"{self.label}: {self.text}"


class Narrative(tuple[Sentence, ...]):
    """Sentences in the order in which they are read; a notebook shows them as paragraphs."""

    __slots__ = ()

    def __str__(self) -> str:
        return "\n".join(map(str, self))

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return "".join(f"<p><b>{sentence.label}:</b> {escape(sentence.text)}</p>\n" for sentence in self)

"""What a kind of planning task must offer to `lptn plan`: reading, solving, and four ways to show the answer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from lptn.model.model import Model

Task = TypeVar("Task")


class Answer(Protocol):
    """A solved task, or one that can't be met with what is in the way: both are answers."""

    def table(self) -> DataFrame:
        """The plan as rows of a table; units in the column names, `torque.FR_calf [N*m]`. `lptn plan -o` writes it."""
        ...

    def figure(self) -> Figure:
        """The plan as a picture. `lptn plan --plot` writes it."""
        ...

    def as_json(self) -> dict[str, object]:
        """The plan for programs, SI and degC; numbers that are not finite become null when it is written."""
        ...

    def text(self) -> str:
        """What a person reads on the terminal, several lines; what was given up stands first."""
        ...


class Kind(Protocol[Task]):
    """One kind of task, chosen by `kind = "..."` in the table `[task]` of the task file."""

    def read(self, table: Mapping[str, Any], origin: str, model: Model) -> Task:
        """A task from the whole parsed task file.

        Args:
            table: the parsed TOML document; `table["task"]["kind"]` has chosen this kind.
            origin: the task file, for messages and for paths beside it.
            model: the model that the task is about.

        Raises:
            InputError: something in it can't be used.
        """
        ...

    def run(self, task: Task) -> Answer:
        """Solve a task. What can't be met is said in the answer, it is no exception."""
        ...


@runtime_checkable
class EmitsC(Protocol):
    """A kind that can also write its step as C code for a robot (`lptn plan --emit-c DIR`)."""

    def emit_c(self, task: Any, folder: Path) -> list[Path]:
        """Write the C files into a folder, made if missing; returns the files, in the order a person reads them."""
        ...

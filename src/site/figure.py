"""Figures that a page's code made, and scripts run as notebooks, as part of a page."""

from __future__ import annotations

import re
from base64 import b64encode
from contextlib import chdir, redirect_stdout
from html import escape
from io import BytesIO, StringIO
from mimetypes import guess_type
from pathlib import Path
from typing import TYPE_CHECKING

from lptn.basics import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure(name: str, caption: str) -> str:
    """A picture with its caption, as HTML.

    Args:
        name: of the file, `.svg` or `.png`.
        caption: what is to be seen; also what stands for the picture where it can't be seen.
    """
    words = escape(caption)
    picture = f'<img src="{_address(Path(name).read_bytes(), guess_type(name)[0])}" alt="{words}">'
    return f"<figure>{picture}<figcaption>{words}</figcaption></figure>"


def _address(picture: bytes, kind: str | None) -> str:
    return f"data:{kind};base64,{b64encode(picture).decode()}"


def notebook(script: str) -> str:
    """A script in the percent format, run cell by cell in its folder: text, code and results, as Markdown.

    Args:
        script: its path; the heading that it begins with is left to the page.
    """
    path, parts, known = Path(script).resolve(), list[str](), dict[str, object]()

    def drawn(figure: Figure) -> None:
        picture = BytesIO()
        figure.savefig(picture, format="svg")
        address = _address(picture.getvalue(), "image/svg+xml")
        parts.append(f'<figure><img src="{address}" alt="what this cell draws"></figure>')

    usual, style.show = style.show, drawn
    try:
        with chdir(path.parent):
            for cell in re.split(r"^# %%", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
                title, _, code = cell.partition("\n")
                if title.strip() == "[markdown]":
                    parts.append(re.sub(r"^# ?", "", re.sub(r"^# # .*\n", "", code), flags=re.MULTILINE))
                    continue
                parts.append(f"{title.strip()}\n\n```python\n{code.strip()}\n```")
                printed, before = StringIO(), len(parts)
                with redirect_stdout(printed):
                    exec(compile(code, path.name, "exec"), known)
                if printed.getvalue():
                    parts.insert(before, f"```text\n{printed.getvalue().rstrip()}\n```")
    finally:
        style.show = usual
    return "\n\n".join(parts)

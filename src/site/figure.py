"""Figures that a page's code made, as part of the page."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from mimetypes import guess_type
from pathlib import Path


def figure(name: str, caption: str) -> str:
    """A picture with its caption, as HTML.

    Args:
        name: of the file, `.svg` or `.png`.
        caption: what is to be seen; also what stands for the picture where it can't be seen.
    """
    data = b64encode(Path(name).read_bytes()).decode()
    words = escape(caption)
    picture = f'<img src="data:{guess_type(name)[0]};base64,{data}" alt="{words}">'
    return f"<figure>{picture}<figcaption>{words}</figcaption></figure>"

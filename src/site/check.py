"""The built site: every link inside it leads somewhere, and no page fetches anything from elsewhere.

`python check.py FOLDER` lists what is wrong and exits 1.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_FETCHED = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "image": "href",
    "use": "href",
}
_LINK_KINDS = {"stylesheet", "preconnect", "preload", "prefetch", "icon", "manifest", "modulepreload", "dns-prefetch"}
_CSS_ADDRESS = re.compile(r"(?:url\(\s*|@import\s+)[\"']?([^\"')\s;]+)")


@dataclass
class Document(HTMLParser):
    """What a page links to, fetches, and can be linked to by."""

    text: str
    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        told = {name: value or "" for name, value in attrs}
        self.anchors |= {told[name] for name in ("id", "name") if name in told}
        if tag == "a" and "href" in told:
            self.links.append(told["href"])
        if tag == "link" and _LINK_KINDS & set(told.get("rel", "").split()):
            self.fetched.append(told.get("href", ""))
        if tag in _FETCHED and _FETCHED[tag] in told:
            self.fetched.append(told[_FETCHED[tag]])
        self.fetched += _CSS_ADDRESS.findall(told.get("style", ""))


def faults(site: Path) -> list[str]:
    """What is wrong with a built site, a line each.

    Args:
        site: its folder.
    """
    pages = {path.resolve(): Document(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    if not pages:
        return [f"{site}: no page"]
    found = []
    for path, page in pages.items():
        here = path.relative_to(site.resolve())
        found += [f"{here}: fetches {address}" for address in page.fetched if _is_elsewhere(address)]
        for address in page.links + page.fetched:
            at_root = path.name == "404.html" and address.startswith(
                "/"
            )  # shown at any address, so it begins at the top
            inside = address.removeprefix("/") if at_root else address
            if not _is_elsewhere(address) and not _leads_somewhere(inside, path, pages):
                found.append(f"{here}: {address} leads nowhere")
    for path in site.rglob("*.css"):
        addresses = _CSS_ADDRESS.findall(path.read_text(encoding="utf-8"))
        found += [f"{path.relative_to(site)}: fetches {address}" for address in addresses if _is_elsewhere(address)]
    return found


def _is_elsewhere(address: str) -> bool:
    parts = urlsplit(address)
    return bool(parts.netloc) or parts.scheme in ("mailto", "javascript")


def _leads_somewhere(address: str, path: Path, pages: dict[Path, Document]) -> bool:
    parts = urlsplit(address)
    if parts.scheme == "data":
        return True
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    target = target / "index.html" if target.is_dir() else target
    if not parts.fragment or target not in pages:
        return target.is_file()
    return unquote(parts.fragment) in pages[target].anchors


if __name__ == "__main__":
    wrong = faults(Path(sys.argv[1]))
    print("\n".join(wrong), file=sys.stderr) if wrong else print(
        "the site's links lead somewhere, and nothing is fetched from elsewhere"
    )
    sys.exit(bool(wrong))

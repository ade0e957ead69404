"""Puts the pages of the site together: its own, those of the rooms that they include, and what programs write.

`python compose.py FOLDER` writes the Markdown that the site is built from. A page includes another one of the
project, or one section of it, by a line of its own: `{{ src/lptn/README.md#how-it-decides }}`. What is included keeps
its links: they lead to the page of the site that includes their target, and elsewhere to a copy of the file. Pages of
the site reach the project's files by `repo:`, as in `[a log](repo:examples/tclab/log.csv)`. `{{ commands }}` is
written by the command line's own help, `{{ bibliography }}` by `lptn.references`.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path, PurePosixPath
from posixpath import dirname, join, normpath, relpath

from lptn.basics.errors import InputError
from lptn.references import bibliography

ROOT = Path(__file__).parents[2]
PAGES = Path(__file__).with_name("pages")
COPIED = "files"  # folder of the site that holds copies of the project's files
PLAYGROUND = "first_hour"  # where in the checkout readers make a folder for each page

_INCLUDED = re.compile(r"^\{\{ (\S+?)(?:#(\S+))? \}\}$", re.MULTILINE)
_CODE = r"^```.*?^```|`[^`\n]+`"
_LINK = r"(!?)\[((?:[^\[\]]|\[[^\[\]]*\](?:\([^()]*\))?)*)\]\(([^)\s]+)\)"
_CODE_OR_LINK = re.compile(f"{_CODE}|{_LINK}", re.MULTILINE | re.DOTALL)
_HEADING = re.compile(r"^(#+) +(.*)$")
_ELSEWHERE = ("http:", "https:", "mailto:")
CATALOGUE = "src/lptn/effects/README.md"
_WORK = re.compile(r"^### \w+(?:-\w+)*$", re.MULTILINE)
_RUN = re.compile(r'^```(\w+) exec="true"', re.MULTILINE)


def compose(pages: dict[str, str]) -> tuple[dict[str, str], set[str]]:
    """The pages of the site as they are built.

    Args:
        pages: Markdown with what is to be included, by its path on the site.

    Returns:
        Markdown by path, with a page more for each page of the project that is linked to and included nowhere; and the
        other files of the project that are linked to.

    Raises:
        InputError: a link leads to no file, or an included section is none.
    """
    pages, composed, files = dict(pages), {}, set()
    included = {(name, anchor): uri for uri, text in pages.items() for name, anchor in _INCLUDED.findall(text)}
    while waiting := [uri for uri in pages if uri not in composed]:
        for uri in waiting:
            page = _Page(uri, included)
            composed[uri] = run_in_its_folder(page.with_links(_INCLUDED.sub(page.text_of, pages[uri])), uri)
            for name in page.files:
                if name.endswith(".md"):
                    pages.setdefault(f"{COPIED}/{name}", f"{{{{ {name} }}}}")
                else:
                    files.add(name)
    return composed, files


class _Page:
    """One page of the site while it is put together.

    Args:
        uri: its path on the site.
        included: where on the site pages of the project stand, by path and section ("" for all of it).
    """

    def __init__(self, uri: str, included: dict[tuple[str, str], str]) -> None:
        self.uri = uri
        self.files: set[str] = set()  # of the project that this page links to
        self._included = included

    def text_of(self, directive: re.Match[str]) -> str:
        """What stands for a directive."""
        name, anchor = directive.groups()
        if name in WRITTEN:
            return WRITTEN[name]()
        text = (ROOT / name).read_text(encoding="utf-8")
        if name == CATALOGUE:  # its works are found in the bibliography
            text = _WORK.sub(r"\g<0> { data-search-exclude }", text)
        return self.with_links(section(text, anchor) if anchor else text, name)

    def with_links(self, text: str, origin: str = "") -> str:
        """A text whose links lead where they should from this page; what stands in code is no link.

        Args:
            text: Markdown.
            origin: the project's page that it comes from; without one, links are the site's own, or `repo:`.
        """
        return _CODE_OR_LINK.sub(lambda found: self._code_or_link(found, origin), text)

    def _code_or_link(self, found: re.Match[str], origin: str) -> str:
        mark, words, target = found.groups()
        if target is None:
            return found[0]
        words = self.with_links(words, origin)  # a picture may be a link
        if target.startswith("repo:"):
            return self._to_project(mark, words, target.removeprefix("repo:"))
        if not origin or target.startswith(_ELSEWHERE):
            return f"{mark}[{words}]({target})"
        goal = origin + target if target.startswith("#") else normpath(join(dirname(origin), target))
        return self._to_project(mark, words, goal)

    def _to_project(self, mark: str, words: str, target: str) -> str:
        name, _, anchor = target.partition("#")
        if (ROOT / name / "README.md").is_file():
            name = f"{name}/README.md"
        if not (ROOT / name).exists():
            raise InputError(self.uri, target, "no such file in the project", "a path from its root")
        if (name, anchor) in self._included:
            return f"{mark}[{words}]({self._from_here(self._included[name, anchor])})"
        if (ROOT / name).is_dir():
            return words if words.strip("`") == name else f"{words} (`{name}`)"
        uri = self._included.get((name, ""))
        if uri is None:  # a copy of what a page includes would be found twice
            self.files.add(name)
            uri = f"{COPIED}/{name}"
        return f"{mark}[{words}]({self._from_here(uri)}{anchor and '#'}{anchor})"

    def _from_here(self, uri: str) -> str:
        return relpath(uri, dirname(self.uri) or ".")


def section(text: str, anchor: str) -> str:
    """What stands under a heading of a page, without the heading; its own headings begin at the second level.

    Args:
        text: the page.
        anchor: of the heading, as GitHub makes it: `how-it-decides`.

    Raises:
        InputError: there is no such heading.
    """
    inside: list[str] = []
    level, in_code = 0, False
    for line in text.splitlines():
        in_code ^= line.startswith("```")
        heading = None if in_code else _HEADING.match(line)
        if heading and level and len(heading[1]) <= level:
            break
        if level:
            inside.append(f"{'#' * (len(heading[1]) - level + 1)} {heading[2]}" if heading else line)
        elif heading and re.sub(r"[^\w\- ]", "", heading[2].lower()).replace(" ", "-") == anchor:
            level = len(heading[1])
    if not level:
        raise InputError("site", anchor, "no heading has this anchor", "a heading of the page that is included")
    return "\n".join(inside)


def run_in_its_folder(text: str, uri: str) -> str:
    """A page whose code is run in the folder that it tells readers to make: none leans on the files of another.

    Args:
        text: the page.
        uri: its path on the site.
    """
    folder = f"{PLAYGROUND}/{PurePosixPath(uri).stem}"
    return _RUN.sub(rf'\g<0> workdir="{folder}"', text)


def commands() -> str:
    """Every command with its options, by the command line itself."""
    from cyclopts.docs.markdown import generate_markdown_docs

    from lptn.cli.main import app

    options = [name for name in app if name.startswith("--")]
    text = generate_markdown_docs(app, generate_toc=False, exclude_commands=options)
    return re.sub(r"^Example: (lptn .*)$", r"Example: `\1`", text.removeprefix("# lptn\n"), flags=re.MULTILINE)


def works() -> str:
    """Every work of the bibliography, with what is cited of it and what is printed wrong there."""
    lines = []
    for key, work in bibliography().items():
        lines += [f"## {key} {{ #work-{key} }}", "", work.full, ""]
        lines += [f"- {place}: {work.what_stands_at(place)}" for place in work.places]
        lines.append("")
    return "\n".join(lines)


WRITTEN = {"commands": commands, "bibliography": works}


def main(folder: Path) -> None:
    """Write the pages and the files that they link to.

    Args:
        folder: where to; made if it isn't there.
    """
    shutil.copytree(PAGES, folder, dirs_exist_ok=True)
    own = {path.relative_to(PAGES).as_posix(): path.read_text(encoding="utf-8") for path in PAGES.rglob("*.md")}
    pages, files = compose(own)
    for uri, text in pages.items():
        (folder / uri).parent.mkdir(parents=True, exist_ok=True)
        (folder / uri).write_text(text, encoding="utf-8")
    for name in files:
        (folder / COPIED / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, folder / COPIED / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

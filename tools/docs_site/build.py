"""Build the site of the documentation: python tools/docs_site/build.py, or `make docs`.

The pages in docs/ are plain Markdown that reads well on a forge. This puts them together with what comes from the
code (commands, public names, tables of contents) in build/docs, and has Sphinx make the site in results/site of it.
Warnings are errors, and a page that asks for anything from the network is refused.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from generated import api_pages, commands_page
from structure import CHILDREN, MOVED

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
DOCS = ROOT / "docs"
SOURCE = ROOT / "build" / "docs"
SITE = ROOT / "results" / "site"
LINK = re.compile(r"(\]\()([^)\s#]+)(#[^)\s]*)?(\))")
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
GALLERY = re.compile(r"<!-- gallery -->\n(.*?)<!-- end of gallery -->", re.DOTALL)
# What a browser fetches by itself. Links that a reader follows are no part of it.
FETCHED = re.compile(
    r"<(?:script|img|iframe|source|video|audio|embed)\b[^>]*\bsrc=\"((?:https?:)?//[^\"]+)\""
    r"|<link\b(?![^>]*rel=\"(?:canonical|next|prev|search|index)\")[^>]*\bhref=\"((?:https?:)?//[^\"]+)\""
)


def relinked(text: str, origin: Path, page: str) -> str:
    """A page with its links to files of the repository turned to the places that these have on the site.

    Parameters
    ----------
    text : str
        Markdown.
    origin : Path
        The file that it comes from.
    page : str
        Where it lies on the site.
    """

    def turned(match: re.Match[str]) -> str:
        target = match[2]
        if re.match(r"[a-z]+:", target):
            return match[0]
        path = (origin.parent / target).resolve()
        if path.is_relative_to(DOCS):
            place = path.relative_to(DOCS).as_posix()
        else:
            place = MOVED.get(path.relative_to(ROOT).as_posix(), "")
        if not place:
            raise SystemExit(f"{origin.relative_to(ROOT)}: the site has no page for {target}")
        return f"{match[1]}{os.path.relpath(place, Path(page).parent)}{match[3] or ''}{match[4]}"

    parts = re.split(f"({FENCE.pattern})", text, flags=FENCE.flags)
    return "".join(part if part.startswith("```") else LINK.sub(turned, part) for part in parts)


def cards(match: re.Match[str]) -> str:
    """A gallery, which is a table on a forge, as a grid of cards."""
    rows = [line.strip().strip("|") for line in match[1].splitlines() if line.startswith("| [")]
    lines = [":::::{grid} 1 2 2 2", ":gutter: 3", ":class-container: gallery", ""]
    for cell in (cell.strip() for row in rows for cell in row.split(" | ")):
        found = re.fullmatch(r"\[!\[([^]]*)\]\(([^)]+)\)\]\(([^)]+)\)<br>\*\*(.+?)\*\*<br>(.+)<br>`([^`]+)`", cell)
        if not found:
            raise SystemExit(f"the gallery has a cell that is none of its kind: {cell}")
        alt, image, page, title, text, command = found.groups()
        target, _, anchor = page.partition("#")
        url = target.rpartition(".")[0] + ".html" + (f"#{anchor}" if anchor else "")
        lines += [
            f"::::{{grid-item-card}} {title}", f":img-top: {image}", f":img-alt: {alt}", f":link: {url}",
            ":link-type: url", "", text, "", ":::{card-footer}", f"`{command}`", ":::", "::::", "",
        ]  # fmt: skip
    return "\n".join([*lines, ":::::", ""])


def contents(page: str, below: list[str]) -> str:
    """The table of contents that Sphinx asks for, which no reader sees."""
    folder = Path(page).parent
    entries = [os.path.relpath(name, folder) for name in below]
    return "\n".join(["", "```{toctree}", ":hidden:", "", *entries, "```", ""])


def placed(pages: set[str]) -> dict[str, list[str]]:
    """For each page the pages below it, with the patterns of `structure.CHILDREN` filled in."""
    named = {name for below in CHILDREN.values() for name in below if "*" not in name} | {"index"}
    missing = named - pages
    if missing:
        raise SystemExit(f"tools/docs_site/structure.py names pages that there are not: {sorted(missing)}")
    found: dict[str, list[str]] = {}
    for page, below in CHILDREN.items():
        found[page] = []
        for name in below:
            if "*" not in name:
                found[page].append(name)
                continue
            rest = sorted(page for page in pages - named if Path(page).parent == Path(name).parent)
            found[page] += rest
            named |= set(rest)
    lost = pages - named
    if lost:
        raise SystemExit(f"tools/docs_site/structure.py has no place for {sorted(lost)}")
    return found


def assemble() -> None:
    """Put the pages of the site together in `SOURCE`."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    shutil.copytree(DOCS, SOURCE, ignore=shutil.ignore_patterns(".ipynb_checkpoints", "__pycache__"))
    origins = {path.relative_to(DOCS).as_posix(): path for path in DOCS.rglob("*.md")}
    origins |= {place: ROOT / name for name, place in MOVED.items()}
    texts = {page: relinked(path.read_text(encoding="utf-8"), path, page) for page, path in origins.items()}
    texts |= {"reference/commands.md": commands_page()} | api_pages()
    notebooks = {path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.ipynb")}
    below = placed({page.removesuffix(".md") for page in texts} | notebooks)
    for page, text in texts.items():
        text = GALLERY.sub(cards, text)
        name = page.removesuffix(".md")
        target = SOURCE / page
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text + (contents(name, below[name]) if name in below else ""), encoding="utf-8")


def from_network(site: Path) -> list[str]:
    """What pages and styles would fetch from elsewhere when they are opened."""
    found = []
    for path in sorted([*site.rglob("*.html"), *site.rglob("*.css")]):
        text = path.read_text(encoding="utf-8", errors="replace")
        pattern = (
            FETCHED if path.suffix == ".html" else re.compile(r"(?:url\(|@import )[\"']?((?:https?:)?//[^\"')]+)")
        )
        found += [f"{path.relative_to(site)}: {next(filter(None, m.groups()))}" for m in pattern.finditer(text)]
    return found


def main() -> int:
    """Assemble, build, and see that nothing comes from the network; the exit code."""
    assemble()
    shutil.rmtree(SITE, ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-c", str(HERE), "-d", str(SOURCE.parent / "doctrees")]
    # Afresh each time: an old tree of pages would hide warnings.
    command += ["-E", "-W", "--keep-going", "-q", str(SOURCE), str(SITE)]
    # Kernels of notebooks are to say what goes wrong, and nothing else.
    profile = SOURCE.parent / "ipython" / "profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    (profile / "ipython_kernel_config.py").write_text("c.IPKernelApp.log_level = 40\n", encoding="utf-8")
    environment = os.environ | {"IPYTHONDIR": str(profile.parent), "PYDEVD_DISABLE_FILE_VALIDATION": "1"}
    code = subprocess.run(command, check=False, env=environment).returncode
    if code:
        return code
    fetched = from_network(SITE)
    for line in fetched:
        print(f"asks for something from the network: {line}", file=sys.stderr)
    if not fetched:
        print(f"open {SITE.relative_to(ROOT)}/index.html")
    return bool(fetched)


if __name__ == "__main__":
    sys.exit(main())

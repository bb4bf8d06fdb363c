"""Hook of mkdocs: pages made of files outside of docs/, the gallery, the API reference, and the links between them.

README, CHANGELOG, CONTRIBUTING, NOTICE and the model cards become pages; each example is a page with what
`scripts/make_gallery.py` kept of it. Links of all pages point to files of the repository and are turned here.
"""

from __future__ import annotations

import ast
import posixpath
import re
from importlib import import_module
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

REPOSITORY = Path(__file__).resolve().parents[1]
CARDS = {"src/kpred/bundled/model": "kp-red-plus", "paper/src/kpred_paper": "kp-red"}
"""Folders of models, and the folders of their cards in the site."""

ROOT_PAGES = {
    "paper/README.md": "kp_red.md",
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "NOTICE": "notice.md",
    "examples": "gallery/index.md",
}
"""Path in the repository -> page of the site."""

PUBLIC = {
    "kpred": "Fit a scan, open a database, read and write files.",
    "kpred.fitting": "The pipeline and its result.",
    "kpred.database": "CAD models with all that is computed of them.",
    "kpred.nn": "Networks and their weights.",
    "kpred.shapes": "Meshes, scans, packs, cameras and their files.",
    "kpred.ops": "Geometry on arrays and tensors.",
    "kpred.batch": "Very many scans.",
}
"""Packages with public names, each a page of the API reference."""

MODULES = {
    "kpred.evaluation": ("methods.method", "tables.config", "tables.make_table", "tables.table"),
    "kpred.fitting": ("fit_scene",),
    "kpred.pose": ("estimators",),
    "kpred.preprocessing": ("config", "clean"),
    "kpred.refinement": ("config", "structure_config", "score"),
    "kpred.rendering": ("overlay",),
    "kpred.scenes": ("scene", "objects", "instances"),
    "kpred.training": ("config", "run"),
    "kpred.errors": ("",),
}
"""Modules that examples and scripts import by their full name."""

_LINK = re.compile(r"(\]\()([^)\s]+)(\))")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """List the generated pages in the navigation, where it names their folder."""
    notes = {f"notes/{file.name}" for file in (REPOSITORY / "docs" / "notes").glob("*.md")}
    made = {*_outside().values(), *_gallery(), *_reference(), *notes}
    for section in config.nav or []:
        for entry in next(iter(section.values())):
            for title, folder in entry.items() if isinstance(entry, dict) else ():
                if folder.endswith("/"):
                    entry[title] = sorted(made_in for made_in in made if made_in.startswith(folder))
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    for source, page in _outside().items():
        if source != "examples":
            files.append(File.generated(config, page, content=_text(source)))
    for page, content in {**_gallery(), **_reference()}.items():
        files.append(File.generated(config, page, content=content))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links to files of the repository into links to pages."""
    pages = _outside()
    by_page = {made: name for name, made in pages.items() if name != "examples"}
    source = by_page.get(page.file.src_uri, f"docs/{page.file.src_uri}")
    here = posixpath.dirname(page.file.src_uri)

    def turned(found: re.Match[str]) -> str:
        name, _, heading = found[2].partition("#")
        if not name or re.match(r"[a-z]+:", name):
            return found[0]
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), name))
        target = pages.get(target, target.removeprefix("docs/"))
        return f"{found[1]}{posixpath.relpath(target, here or '.')}{'#' + heading if heading else ''}{found[3]}"

    return _LINK.sub(turned, markdown)


def _outside() -> dict[str, str]:
    cards = {}
    for root, folder in CARDS.items():
        for card in sorted((REPOSITORY / root).rglob("README.md")):
            page = str(card.relative_to(REPOSITORY / root)).replace("/README", "")
            cards[str(card.relative_to(REPOSITORY))] = f"cards/{folder}/{page}"
    return ROOT_PAGES | cards


def _text(source: str) -> str:
    text = (REPOSITORY / source).read_text()
    return f"# Notice\n\n```text\n{text}```\n" if source == "NOTICE" else text


def _gallery() -> dict[str, str]:
    """Write the page of each example, and the page of all."""
    pages, cards = {}, []
    for example in sorted((REPOSITORY / "examples").glob("*.py")):
        code = example.read_text()
        summary, _, rest = (ast.get_docstring(ast.parse(code)) or "").partition("\n")
        kept = REPOSITORY / "docs" / "gallery" / example.stem
        picture = f"![{example.stem}]({example.stem}.png)\n\n" if kept.with_suffix(".png").exists() else ""
        usage = re.sub(r"^ *(python examples/.*)$", r"    \1", rest.strip(), flags=re.M)
        body = code.split('"""', 2)[2].strip()
        pages[f"gallery/{example.stem}.md"] = (
            f"# {summary}\n\n{picture}{usage}\n\n```python\n{body}\n```\n\n"
            f"Output:\n\n```text\n{kept.with_suffix('.txt').read_text()}```\n"
        )
        cards.append(f"## [{summary}]({example.stem}.md)\n\n{picture}")
    return pages | {"gallery/index.md": "# Gallery\n\n" + "".join(cards)}


def _reference() -> dict[str, str]:
    """Pages of the API reference: each object is described once, and referred to from other pages."""
    pages: dict[str, str] = {}
    described = {f"{package}.{name}".rstrip(".") for package, names in MODULES.items() for name in names}
    for package in dict.fromkeys((*PUBLIC, *MODULES)):
        module: Any = import_module(package)
        summary = PUBLIC.get(package) or (module.__doc__ or "").partition("\n")[0]
        blocks, elsewhere = [], []
        for place in _places(module) if package in PUBLIC else ():
            if place in described or place.rpartition(".")[0] in described:
                elsewhere.append(f"[`{place.rpartition('.')[2]}`][{place}]")
            else:
                blocks.append(f"::: {place}\n")
                described.add(place)
        blocks += [f"::: {package}.{name}".rstrip(".") + "\n" for name in MODULES.get(package, ())]
        others = [f"Described elsewhere: {', '.join(elsewhere)}.\n"] if elsewhere else []
        pages[f"api/{package}.md"] = "\n".join([f"# {package}\n\n{summary}\n", *others, *blocks])
    lines = [f"- [{name.removeprefix('api/').removesuffix('.md')}]({name.removeprefix('api/')})" for name in pages]
    return pages | {"api/index.md": "# API reference\n\n" + "\n".join(lines) + "\n"}


def _places(module: Any) -> list[str]:
    """Full names of a package's public classes, functions and constants, where they are defined."""
    names = [name for name in sorted(module.__all__) if not name.startswith("__")]
    return [f"{getattr(getattr(module, name), '__module__', module.__name__)}.{name}" for name in names]

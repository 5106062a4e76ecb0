"""MkDocs hooks: pages of the repository outside docs/ join the site; nothing is loaded from elsewhere."""

import re
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
OUTSIDE = {  # path in the repository: path in the site
    "README.md": "index.md",
    "studies/README.md": "studies.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
LINK = re.compile(r"(\]\()([^)\s#:]+)(#[^)\s]*)?(\))")
FOREIGN = re.compile(r"<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=\"(?:https?:)?//[^\"]*\"")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages outside docs/."""
    for source, page in OUTSIDE.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links between files of the repository into links between pages of the site."""
    address = page.file.src_uri
    source = {page: path for path, page in OUTSIDE.items()}.get(address, f"docs/{address}")

    def link(match: re.Match[str]) -> str:
        path = (ROOT / source).parent.joinpath(match[2]).resolve()
        name = path.relative_to(ROOT).as_posix()
        target = "../" * address.count("/") + OUTSIDE.get(name, name.removeprefix("docs/"))
        return f"{match[1]}{target}{match[3] or ''}{match[4]}"

    parts = re.split(r"(```.*?```)", markdown, flags=re.DOTALL)
    return "".join(part if part.startswith("```") else LINK.sub(link, part) for part in parts)


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Refuse a page that loads a script, a font or a picture from another host."""
    foreign = FOREIGN.search(output)
    if foreign:
        raise PluginError(f"{page.file.src_uri} loads from another host: {foreign[0]}")
    return output

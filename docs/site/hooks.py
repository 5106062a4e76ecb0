"""MkDocs hooks: pages outside docs/ and notebooks join the site; nothing is loaded from elsewhere."""

import html
import json
import re
from collections.abc import Iterator
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
    for notebook in sorted((ROOT / "docs" / "tutorials").glob("*.ipynb")):
        files.remove(files.src_uris[f"tutorials/{notebook.name}"])
        text = "\n\n".join(cells(notebook))
        files.append(File.generated(config, f"tutorials/{notebook.stem}.md", content=text))
    return files


def cells(notebook: Path) -> Iterator[str]:
    """The cells of a notebook in Markdown, each with what it has printed and drawn."""
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            yield source
        else:
            command = source.startswith("!")
            yield f"```console\n$ {source[1:]}\n```" if command else f"```python\n{source}\n```"
            yield from filter(None, map(shown, cell["outputs"]))


def shown(output: dict[str, Any]) -> str:
    """One output: a picture, a table, or text."""
    data = output.get("data", {})
    if "image/png" in data:
        picture = "".join(data["image/png"]).replace("\n", "")
        return f'<p><img alt="output of the cell above" src="data:image/png;base64,{picture}"></p>'
    if "text/html" in data:
        return re.sub(r"<style.*?</style>|\n", "", "".join(data["text/html"]), flags=re.DOTALL)
    text = html.escape("".join(output.get("text", data.get("text/plain", ""))), quote=False)
    return f'<pre class="output">{text.rstrip()}</pre>'.replace("\n\n", "\n&#8203;\n")


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links between files of the repository into links between pages of the site."""
    address = page.file.src_uri
    source = {page: path for path, page in OUTSIDE.items()}.get(address, f"docs/{address}")

    def link(match: re.Match[str]) -> str:
        path = (ROOT / source).parent.joinpath(match[2]).resolve()
        name = path.relative_to(ROOT).as_posix()
        page_of = OUTSIDE.get(name, name.removeprefix("docs/")).replace(".ipynb", ".md")
        target = "../" * address.count("/") + page_of
        return f"{match[1]}{target}{match[3] or ''}{match[4]}"

    parts = re.split(r"(```.*?```)", markdown, flags=re.DOTALL)
    return "".join(part if part.startswith("```") else LINK.sub(link, part) for part in parts)


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Refuse a page that loads a script, a font or a picture from another host."""
    foreign = FOREIGN.search(output)
    if foreign:
        raise PluginError(f"{page.file.src_uri} loads from another host: {foreign[0]}")
    return output

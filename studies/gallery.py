"""Run the lines of docs/gallery.md and renew its pictures: small, and each named as the lines name it.

    python studies/gallery.py

A block below a comment ``not run`` is left out, and its pictures stay (``--all`` runs those in
Python, which need packages that are no extras). Some three minutes of processor time.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "gallery.md"
BLOCK = re.compile(r"(<!-- not run.*?-->\n)?^```(console|python)\n(.*?)^```$", re.M | re.S)
PICTURE = re.compile(r"\]\(gallery/([\w-]+\.png)\)")
WIDTH, COLOURS = 760, 64  # pixels; a palette is a third of the bytes


def run(kind: str, text: str, folder: Path) -> None:
    """Run one block in ``folder``."""
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "MPLBACKEND": "agg",
    }
    commands = [line[2:].split() for line in text.splitlines() if line.startswith("$ ")]
    if kind == "python":
        commands = [[sys.executable, "-c", text]]
    for command in commands:
        print("$", " ".join(command) if kind == "console" else "python", flush=True)
        subprocess.run(command, cwd=folder, env=environment, check=True)


def shrink(source: Path, target: Path) -> None:
    """Write a picture no wider than ``WIDTH``, with a palette."""
    picture = Image.open(source).convert("RGB")
    if picture.width > WIDTH:
        height = round(picture.height * WIDTH / picture.width)
        picture = picture.resize((WIDTH, height), Image.Resampling.LANCZOS)
    few = picture.quantize(
        COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE
    )  # the median cut loses the colour of a thin line
    few.save(target, optimize=True)


def main() -> None:
    """Run the page; copy every picture that its lines have written."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--all", action="store_true", help="Python blocks marked as not run too")
    options = parser.parse_args()
    text = PAGE.read_text(encoding="utf-8")
    target = PAGE.with_suffix("")
    target.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(ROOT / "studies", folder / "studies")
        for spared, kind, block in BLOCK.findall(text):
            if not spared or (options.all and kind == "python"):
                run(kind, block, folder)
        for picture in PICTURE.findall(text):
            made = [path for path in folder.rglob(picture) if "studies" not in path.parts]
            if made:  # several commands draw the track: the first that did
                shrink(min(made, key=lambda path: path.stat().st_mtime), target / picture)
                print(f"{picture}: {(target / picture).stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()

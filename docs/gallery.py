"""Runs the examples, all or those named, and keeps the figure of each for docs/gallery.md."""

import subprocess
import sys
from base64 import b64decode
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient
from PIL import Image

EXAMPLES = Path(__file__).parents[1] / "examples"
GALLERY = Path(__file__).with_name("gallery")
LARGEST = 60_000  # bytes
NODES = {"foresight", "velocity_feedback"}
"""Controllers that other examples use, and that run until Ctrl-C."""


def scripts() -> list[Path]:
    """Return the scripts that write a figure."""
    found = sorted(EXAMPLES.glob("*.py"))
    return [path for path in found if path.stem not in NODES and not path.stem.startswith("test_")]


def notebooks() -> list[Path]:
    """Return the notebooks."""
    return sorted((EXAMPLES / "notebooks").glob("*.ipynb"))


def executed(path: Path) -> nbformat.NotebookNode:
    """Return a notebook with its outputs."""
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(path.parent)}}
    return NotebookClient(notebook, timeout=300, resources=resources).execute()


def figures_in(notebook: nbformat.NotebookNode) -> list[bytes]:
    """Return the figures among the outputs of a notebook, as PNG."""
    outputs = (output for cell in notebook.cells for output in cell.get("outputs", []))
    found = (output.get("data", {}).get("image/png") for output in outputs)
    return [b64decode(figure) for figure in found if figure]


def keep(figure: bytes, name: str) -> None:
    """Write a figure, no wider than 1000 pixels, with as many colours as fit into its size."""
    with Image.open(BytesIO(figure)) as image:
        small = image.convert("RGB")
    small.thumbnail((1000, 1000), Image.Resampling.LANCZOS)
    GALLERY.mkdir(exist_ok=True)
    path = GALLERY / f"{name}.png"
    for colours in (256, 128, 64, 48, 32, 24):
        # Without k-means the greys of a figure that has few colours left turn brown.
        small.quantize(
            colours, Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE
        ).save(path, optimize=True)
        if path.stat().st_size < LARGEST:
            break


def main(names: list[str]) -> None:
    """Run examples, and write their figures."""
    for path in [*scripts(), *notebooks()]:
        if names and path.stem not in names:
            continue
        print(path.stem, flush=True)
        if path.suffix == ".ipynb":
            keep(figures_in(executed(path))[-1], path.stem)
            continue
        with TemporaryDirectory() as folder:
            subprocess.run([sys.executable, path, folder], check=True)
            keep(Path(folder, f"{path.stem}.png").read_bytes(), path.stem)
            for values in Path(folder).glob("*.json"):
                (GALLERY / values.name).write_bytes(values.read_bytes())


if __name__ == "__main__":
    main(sys.argv[1:])

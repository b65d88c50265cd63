"""Runs the examples, all or those named; keeps their figures, and notebooks with their outputs."""

import subprocess
import sys
from base64 import b64decode, b64encode
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient
from PIL import Image

EXAMPLES = Path(__file__).parents[1] / "examples"
GALLERY = Path(__file__).with_name("gallery")
LARGEST = 60_000  # bytes
WITHOUT_FIGURE = {"foresight", "plc_export", "velocity_feedback"}
"""Scripts that other examples and pages use: controllers, and a machine that is recorded."""


def scripts() -> list[Path]:
    """Return the scripts that write a figure."""
    found = sorted(EXAMPLES.glob("*.py"))
    return [
        path
        for path in found
        if path.stem not in WITHOUT_FIGURE and not path.stem.startswith("test_")
    ]


def notebooks() -> list[Path]:
    """Return the notebooks."""
    return sorted((EXAMPLES / "notebooks").glob("*.ipynb"))


def executed(path: Path) -> nbformat.NotebookNode:
    """Return a notebook with its outputs."""
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(path.parent)}}
    client = NotebookClient(notebook, timeout=300, resources=resources, record_timing=False)
    return client.execute()


def results_in(notebook: nbformat.NotebookNode) -> list[dict[str, str]]:
    """Return the results among the outputs of a notebook, each by its media types."""
    return [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]


def small(figure: bytes) -> bytes:
    """Return a figure no wider than 1000 pixels, with as many colours as fit into its size."""
    with Image.open(BytesIO(figure)) as image:
        shown = image.convert("RGB")
    shown.thumbnail((1000, 1000), Image.Resampling.LANCZOS)
    found = figure
    for colours in (256, 128, 64, 48, 32, 24):
        stream = BytesIO()
        # Without k-means the greys of a figure that has few colours left turn brown.
        shown.quantize(
            colours, Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE
        ).save(stream, "PNG", optimize=True)
        found = stream.getvalue()
        if len(found) < LARGEST:
            break
    return found


def main(names: list[str]) -> None:
    """Run examples, and write their figures and the notebooks."""
    for path in [*scripts(), *notebooks()]:
        if names and path.stem not in names:
            continue
        print(path.stem, flush=True)
        if path.suffix == ".ipynb":
            notebook = executed(path)
            with_figure = [data for data in results_in(notebook) if "image/png" in data]
            for data in with_figure:
                data["image/png"] = b64encode(small(b64decode(data["image/png"]))).decode()
            nbformat.write(notebook, path)
            (GALLERY / f"{path.stem}.png").write_bytes(b64decode(with_figure[-1]["image/png"]))
            continue
        with TemporaryDirectory() as folder:
            subprocess.run([sys.executable, path, folder], check=True)
            figure = Path(folder, f"{path.stem}.png").read_bytes()
            (GALLERY / f"{path.stem}.png").write_bytes(small(figure))
            for values in Path(folder).glob("*.json"):
                (GALLERY / values.name).write_bytes(values.read_bytes())


if __name__ == "__main__":
    main(sys.argv[1:])

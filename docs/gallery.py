"""The gallery of experiments: what ``experiments/README.md`` says of each, with its picture where there is one.

``python docs/gallery.py FOLDER`` takes the pictures that experiments have written into ``FOLDER/NAME`` and makes them
small enough for docs/images/gallery; ``experiments/NAME.py --output FOLDER/NAME`` draws them.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images" / "gallery"
WIDTH, MARGIN, COLOURS = 760, 16, 64
PICTURES = {
    "denoise_shapes": "shapes.png",
    "fig01_reflections": "reflections.png",
    "fig03_mean_curvature": "fields.png",
    "fig05_annulus": "strips.png",
    "fig07_principal_meshes": "edges.png",
    "fig10_glass_facade": "facade.png",
    "fig11_energy_per_area": "energy_per_area.png",
    "fig12_pyramids": "pyramids.png",
    "fig12_handles": "handles.png",
    "fig13_boundaries": "square_to_circle.png",
    "fig14_design": "reflections.png",
    "fig14_reflections": "reflections.png",
    "fig14h_polylines": "reflections.png",
    "fig15_tangent_planes": "pipe.png",
    "fig16_canopies": "least_c.png",
    "fig17_pipelines": "pipelines.png",
    "fig18_hybrid_roof": "overlay.png",
    "fig21_principal_remeshing": "edges.png",
    "fig_reflection_ranking": "reflections.png",
    "inverse_design": "points.png",
    "optimise_reflection": "reflections.png",
    "polar_duals": "dual.png",
    "repair_saddles": "saddle_term.png",
    "rounding_off": "rounding_off.png",
    "saddle_samplings": "stars.png",
    "shape_from_mirrors": "surfaces.png",
    "train_form_finding": "surfaces.png",
    "train_height_field": "surfaces.png",
    "train_signed_distance": "surfaces.png",
}
"""Which of the pictures of an experiment stands in the gallery."""


class Entry(NamedTuple):
    """A row of the table of experiments."""

    figure: str
    name: str
    command: str
    claim: str
    result: str


def entries() -> list[Entry]:
    """All rows of the table."""
    rows = re.findall(
        r"^\| (.*?) \| `(python experiments/(\w+)\.py)`(?: \((.*?)\))? \| (.*?) \| (.*) \|$",
        (ROOT / "experiments" / "README.md").read_text(encoding="utf-8"),
        re.M,
    )
    return [
        Entry(figure, name, f"{command}  # {time}", claim, result)
        for figure, command, name, time, claim, result in rows
    ]


def page() -> str:
    """The entries as Markdown."""
    parts = []
    for figure, name, command, claim, result in entries():
        title = f"Figure {figure}" if figure[0].isdigit() else figure.capitalize()
        if not figure[0].isalnum():  # of our own
            title = name.removeprefix("fig_").replace("_", " ").capitalize()
        parts += [f"## {title}", f"**Claim.** {claim}", f"**Result.** {result}"]
        if (IMAGES / f"{name}.png").exists():
            parts.append(f"![{name}](images/gallery/{name}.png)")
        parts.append(f"```sh\n{command}\n```")
    return "\n\n".join(parts)


def shrink(source: Path, target: Path) -> int:
    """Writes a small copy of a picture without its white border, and returns its size in bytes."""
    from PIL import Image, ImageChops

    picture = Image.open(source).convert("RGB")
    inside = ImageChops.difference(picture, Image.new("RGB", picture.size, "white")).getbbox()
    if inside:
        left, top, right, bottom = inside
        ends = min(right + MARGIN, picture.width), min(bottom + MARGIN, picture.height)
        picture = picture.crop((max(left - MARGIN, 0), max(top - MARGIN, 0), *ends))
    picture.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
    return target.stat().st_size


def main() -> None:
    """Makes the small pictures."""
    IMAGES.mkdir(exist_ok=True)
    for name, file in PICTURES.items():
        source = Path(sys.argv[1]) / name / file
        if source.exists():
            print(name, shrink(source, IMAGES / f"{name}.png"))


if __name__ == "__main__":
    main()

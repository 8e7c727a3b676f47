"""Developable strips along principal edges, as files of ``torchfair symmetric``."""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import TorchfairError
from .arguments import non_negative
from .errors import CommandError
from .request import Request, Writer

if TYPE_CHECKING:
    from torch import Tensor

    from ..principal import DevelopableStrips


def add_strips(parser: argparse.ArgumentParser) -> None:
    """The options of strips."""
    add = parser.add_argument
    add("--strips", type=non_negative, metavar="HEIGHT", help="write strips of this height orthogonal to the mesh "
        "along the principal edges: NAME.strips.obj in space with uv, NAME.strips.svg flat")  # fmt: skip
    add("--depth", type=non_negative, default=0.0, metavar="DEPTH", help="how far strips reach to the other side "
        "(default 0)")  # fmt: skip
    add("--millimetres", type=non_negative, default=1.0, metavar="MM", help="length of one unit of INPUT in flat "
        "drawings (default 1)")  # fmt: skip
    add("--sheet-width", type=non_negative, metavar="MM", help="width of a sheet (default: the best of several)")
    add("--sheet-height", type=non_negative, metavar="MM", help="height of a sheet, of which there are as many as it "
        "takes, one above the other in one drawing (default: one sheet, as high as it has to be)")  # fmt: skip
    add("--gap", type=non_negative, metavar="MM", help="distance between strips on a sheet and to its rim, such as the "
        "thickness of the material (default: a quarter of the width of the strips)")  # fmt: skip
    add("--dxf", action="store_true", help="write NAME.strips.dxf too (needs the extra torchfair[dxf])")


class StripFiles:
    """The strips that were asked for; made once, written into several files.

    Args:
        arguments: Of the command.

    Raises:
        CommandError: options contradict each other.
    """

    def __init__(self, arguments: argparse.Namespace) -> None:
        self._height, self._depth, self._millimetres = arguments.strips, arguments.depth, arguments.millimetres
        self._dxf = arguments.dxf
        lengths = {"sheet_width": arguments.sheet_width, "sheet_height": arguments.sheet_height, "gap": arguments.gap}
        given = [name for name, value in lengths.items() if value is not None]
        self._made: DevelopableStrips | None = None
        if arguments.dxf and self._height is None:
            raise CommandError("--dxf: give the height of strips by --strips")
        if given and self._height is None:
            raise CommandError(f"--{given[0].replace('_', '-')}: give the height of strips by --strips")
        if self._height is not None and not self._height + self._depth > 0.0:
            raise CommandError("--strips: a strip needs a height or a depth above 0")
        if not self._millimetres > 0.0:
            raise CommandError("--millimetres: expected a number above 0")
        self._sheet = {name: None if value is None else value / self._millimetres for name, value in lengths.items()}
        self._check_sheet(lengths)
        if arguments.dxf and importlib.util.find_spec("ezdxf") is None:
            raise CommandError("--dxf needs ezdxf: pip install 'torchfair[dxf]'; SVG files do without")

    def _check_sheet(self, lengths: Mapping[str, float | None]) -> None:
        """Refuses sheets on which no strip finds room, before anything is solved."""
        width = ((self._height or 0.0) + self._depth) * self._millimetres
        gap = width / 4 if lengths["gap"] is None else lengths["gap"]
        for name in ("sheet_width", "sheet_height"):
            most = lengths[name]
            if most is not None and most < width + 2.0 * gap:
                raise CommandError(
                    f"--{name.replace('_', '-')}: strips are {width:.6g} mm wide, with gaps {width + 2.0 * gap:.6g}"
                )

    def files(self) -> dict[str, Writer]:
        """Writers by end of the name; none if no strips were asked for."""
        if self._height is None:
            return {}
        files: dict[str, Writer] = {"strips.obj": self._solid, "strips.svg": self._flat}
        return files | ({"strips.dxf": self._drawing} if self._dxf else {})

    def make(self, vertices: Tensor, polylines: list[Tensor], normals: Tensor) -> dict[str, float]:
        """Makes the strips; how true they are, nothing if none were asked for.

        Raises:
            TorchfairError: if they cannot be made or find no room, in words of the command.
        """
        from ..principal import developable_strips
        from ..principal._sheet import SheetError

        if self._height is None:
            return {}
        try:
            self._made = strips = developable_strips(
                vertices, polylines, normals, self._height, depth=self._depth, **self._sheet
            )
        except SheetError as error:
            option, unit = f"--{error.side.replace('_', '-')}", self._millimetres
            raise TorchfairError(
                f"a strip needs {option} {unit * error.needed:.6g} mm with gaps, {unit * error.given:.6g} were given"
            ) from None
        return {
            "strips": len(strips.names),
            "quads": strips.topology.num_faces,
            "largest_planarity": float(strips.planarity.max()),
            "mean_planarity": float(strips.planarity.mean()),
            "largest_isometry_error": float(strips.isometry_errors.max()),
            "sheet_width": strips.sheet[0],
            "sheet_height": strips.sheet[1] / strips.sheets,
            "sheets": strips.sheets,
            "sheet_width_millimetres": self._millimetres * strips.sheet[0],
            "sheet_height_millimetres": self._millimetres * strips.sheet[1] / strips.sheets,
        }

    @property
    def _strips(self) -> DevelopableStrips:
        assert self._made is not None
        return self._made

    def _solid(self, path: Path, request: Request, result: Any, overwrite: bool) -> None:
        from ..principal import save_strips_obj

        save_strips_obj(path, self._strips, overwrite=overwrite)

    def _flat(self, path: Path, request: Request, result: Any, overwrite: bool) -> None:
        from ..principal import save_strips_svg

        save_strips_svg(path, self._strips, millimetres=self._millimetres, overwrite=overwrite)

    def _drawing(self, path: Path, request: Request, result: Any, overwrite: bool) -> None:
        from ..principal import save_strips_dxf

        save_strips_dxf(path, self._strips, millimetres=self._millimetres, overwrite=overwrite)

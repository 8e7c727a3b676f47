"""``torchfair denoise``: removes noise from a scanned mesh and keeps its edges."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from .inputs import add_repair, read_input
from .job_command import JobCommand
from .pictures import draw_before_after
from .request import Request, Writer
from .several import add_inputs

if TYPE_CHECKING:
    from ..formfinding import JobResult, Level


class DenoiseCommand(JobCommand):
    """Removes noise."""

    job = "denoise"
    purpose = "remove noise from a scanned mesh, and keep its edges"
    description = (
        "Moves the vertices of a noisy mesh as little as makes its normal variation E small: faces become flat and "
        "edges stay sharp. Estimates how much noise there is. Writes the mesh, a report and a picture of before and "
        "after. Best on bodies of flat and singly curved faces; --curved for organic shapes."
    )
    pictures: ClassVar[Mapping[str, Writer]] = {"before_after.png": draw_before_after}

    def settings(self) -> type[Any]:
        """See the base class."""
        from ..settings.denoise_settings import DenoiseSettings

        return DenoiseSettings

    def function(self) -> Callable[..., JobResult[Level]]:
        """See the base class."""
        from ..formfinding import denoise

        return denoise

    def add_inputs(self, parser: argparse.ArgumentParser) -> None:
        """A mesh."""
        add_inputs(parser, "mesh file, or a built-in example:NAME")
        add_repair(parser)

    def read(self, arguments: argparse.Namespace, settings: Any) -> Request:
        """See the base class."""
        return Request(read_input(arguments.input, arguments), {})


COMMAND = DenoiseCommand()

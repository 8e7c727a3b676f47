"""Temporary."""

from __future__ import annotations

from typing import Any


def ported(function: Any) -> Any:
    def run(*a: Any, **k: Any) -> Any:
        from ..formfinding import JobResult, Level

        r = function(*a, **k)
        if isinstance(r, JobResult):
            return r
        if hasattr(r, "stages"):
            n = max(r.levels) + 1
            levels = [
                Level(r.vertices, r.topology, r.before, r.after, [s for s, l in zip(r.stages, r.levels) if l == i], [])
                for i in range(n)
            ]
            return JobResult(levels, r.notes, False)

        class SL(Level):
            pass

        levels = []
        for l in r.levels:
            x = SL(l.vertices, l.principal.topology, l.before, l.after, l.runs, [])
            object.__setattr__(x, "principal", l.principal)
            object.__setattr__(x, "normals", l.normals)
            levels.append(x)
        return JobResult(levels, r.notes, r.stopped)

    return run

"""Mistakes in blocks, masks, lists of terms and settings: each is an error that names them and how to mend it."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from bars import LENGTHS, VERTICES, solved, stretched, term

from torchfair import ShapeError, TorchfairError
from torchfair.errors import SettingsError
from torchfair.formfinding import FairSettings, FormSettings, SymmetricSettings
from torchfair.linear import ScipyDirect
from torchfair.projection import (
    GuidedProjection,
    ProjectionSettings,
    SmoothAbsolute,
    SmoothNuclearNorm,
    guided_projection,
)

NAN = float("nan")

BLOCKS: dict[str, tuple[object, str]] = {
    "half precision": (
        {"vertices": VERTICES.half()},
        "block 'vertices': expected a tensor of float32 or float64.*float16",
    ),
    "bfloat16": ({"vertices": VERTICES.bfloat16()}, "float32 or float64.*bfloat16"),
    "whole numbers": ({"vertices": VERTICES.long()}, "float32 or float64.*int64"),
    "NumPy": ({"vertices": VERTICES.numpy()}, r"block 'vertices': .*NumPy array \(4, 3\) float64.*torch.as_tensor"),
    "a list": ({"vertices": VERTICES.tolist()}, r"block 'vertices': expected a dense tensor \(n, d\).*got a list"),
    "sparse": ({"vertices": VERTICES.to_sparse()}, "block 'vertices': expected a dense tensor"),
    "one number each": ({"vertices": VERTICES[:, 0]}, r"\(n, 1\) for one number each, got \(4,\)"),
    "a batch": ({"vertices": VERTICES[None]}, r"tensor \(n, d\).*got \(1, 4, 3\)"),
    "no columns": ({"vertices": VERTICES[:, :0]}, r"tensor \(n, d\).*got \(4, 0\)"),
    "a bare tensor": (VERTICES, r"blocks: expected at least one, such as \{.*got \(4, 3\)"),
    "none": ({}, "blocks: expected at least one.*got an empty dict"),
    "two dtypes": (
        {"vertices": VERTICES, "other": VERTICES.float()},
        "block 'other': expected torch.float64 on cpu like",
    ),
    "two devices": ({"vertices": VERTICES, "other": VERTICES.to("meta")}, "block 'other': .* on cpu like.*on meta"),
    "float32 for data": ({"vertices": VERTICES.float()}, r"'bars', data\[0\]: expected torch.float32 like the blocks"),
}


@pytest.mark.parametrize("mistake", BLOCKS)
def test_blocks_that_do_not_fit(mistake: str) -> None:
    blocks, message = BLOCKS[mistake]
    with pytest.raises(ShapeError, match=message):
        guided_projection(blocks, [term()])


def test_terms_and_masks_that_are_none() -> None:
    for terms, message in (
        (term(), "terms: expected a list of ElementTerm, got an ElementTerm"),
        ([term(), [term()]], r"terms\[1\]: expected an ElementTerm \(unpack lists of them with \*\), got a list"),
        ([stretched], r"terms\[0\]: expected an ElementTerm.*got a function"),
    ):
        with pytest.raises(ShapeError, match=message):
            guided_projection({"vertices": VERTICES}, terms)
    mask = torch.zeros(4, dtype=torch.bool)
    for fixed, message in (
        (mask, r"fixed: expected masks by block name, such as \{.*got \(4,\) torch.bool"),
        ({"vertices": torch.tensor([0, 1])}, r"fixed\['vertices'\]: expected a bool mask \(4,\) or \(4, 3\).*int64"),
        ({"vertices": [0, 1]}, r"fixed\['vertices'\]: expected a bool mask.*got a list"),
        ({"vertices": mask.numpy()}, r"fixed\['vertices'\]: expected a bool mask.*torch.as_tensor"),
        ({"vertices": mask[:, None]}, r"fixed\['vertices'\]: expected a bool mask.*got \(4, 1\)"),
    ):
        with pytest.raises(ShapeError, match=message):
            solved(term(), fixed=fixed)


def test_a_compiled_problem_refuses_other_blocks() -> None:
    problem = GuidedProjection({"vertices": VERTICES}, [term()])
    for other in ({"vertices": VERTICES[:3]}, {"vertices": VERTICES.float()}, {"x": VERTICES}):
        with pytest.raises(
            ShapeError, match=r"blocks: expected \{'vertices': \(4, 3\)\} torch.float64 on cpu as compiled"
        ):
            problem.solve(other)
    with pytest.raises(ShapeError, match=r"'bars', data\[0\]"):
        problem.with_terms([term(data=(LENGTHS.float(),))])


BAD_SETTINGS = [
    ({"max_iterations": 2.5}, "max_iterations must be a whole number of at least 0, got 2.5"),
    ({"max_iterations": -1}, "max_iterations must be a whole number of at least 0"),
    ({"patience": 0}, "patience must be a whole number of at least 1"),
    ({"patience": True}, "patience must be a whole number"),
    ({"patience_when_damped": 0}, "patience_when_damped must be a whole number of at least 1"),
    ({"initial_damping": 0.0}, "initial_damping must be a finite number above 0"),
    ({"initial_damping": math.inf}, "initial_damping must be a finite number above 0"),
    ({"gradient_tolerance": -1e-9}, "gradient_tolerance must be a number of at least 0"),
    ({"step_tolerance": "small"}, "step_tolerance must be a number of at least 0, got 'small'"),
    ({"merit_tolerance": NAN}, "merit_tolerance must be a number of at least 0, got nan"),
    ({"least_extrapolation": 0.9}, "least_extrapolation must be a number of at least 1"),
    ({"accuracy": 0.0}, "accuracy must be a number above 0 and at most 1"),
    ({"accuracy": 1.5}, "accuracy must be a number above 0 and at most 1"),
    ({"time_limit": -1.0}, "time_limit must be a number of at least 0"),
    ({"damping_scale": "none"}, "damping_scale must be 'diagonal' or 'identity'"),
    ({"solver": ScipyDirect}, r"solver must be the name of a linear solver or an object such as ScipyDirect\(\)"),
]


@pytest.mark.parametrize(("options", "message"), BAD_SETTINGS)
def test_settings_out_of_range(options: dict[str, object], message: str) -> None:
    with pytest.raises(SettingsError, match=message) as caught:
        ProjectionSettings(**options)
    assert isinstance(caught.value, TorchfairError)
    assert isinstance(caught.value, ValueError)


def test_settings_at_the_ends_of_their_ranges_are_allowed() -> None:
    ProjectionSettings(max_iterations=np.int64(0), patience=1, time_limit=0, accuracy=1.0, least_extrapolation=math.inf)
    ProjectionSettings(gradient_tolerance=0, step_tolerance=np.float32(0.0), merit_tolerance=math.inf)


@pytest.mark.parametrize("loss", [SmoothAbsolute, SmoothNuclearNorm])
@pytest.mark.parametrize("epsilon", [0, -1.0, NAN, math.inf, "0.1"])
def test_smoothing_has_to_be_above_zero(loss: type, epsilon: object) -> None:
    with pytest.raises(SettingsError, match=f"epsilon of {loss.__name__} must be a finite number above 0"):
        loss(epsilon)


def test_settings_of_the_jobs_and_of_solvers_are_torchfair_errors() -> None:
    for make, message in (
        (lambda: FairSettings(boundary="slide"), "boundary must be one of glide, fixed, free, got 'slide'"),
        (lambda: FairSettings(energy_weight="1"), "weights must be at least 0: energy_weight='1'"),
        (lambda: FairSettings(handle_weight=math.inf), "handle_weight=inf; give finite numbers"),
        (lambda: FairSettings(distance_limit=0.0), "distance_limit"),
        (lambda: FairSettings(planar="all"), "planar must be one of"),
        (lambda: FormSettings(smoothing=1.0), "smoothing must be positive and at most coarse_smoothing"),
        (lambda: SymmetricSettings(tight_weight=0.0), "tight_weight must be a number above 0"),
        (lambda: SymmetricSettings(rounds=-1), "rounds must be a whole number of at least 0"),
        (lambda: solved(term(), settings={"max_iterations": 3}), "settings must be ProjectionSettings"),
        (lambda: solved(term(), settings=ProjectionSettings(solver="magic")), "unknown linear solver 'magic'"),
    ):
        with pytest.raises(SettingsError, match=message):
            make()

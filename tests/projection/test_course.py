"""How a run goes on after each step: when a minimum is suspected, and when it is not suspected again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from torchfair.projection import ProjectionSettings, Status
from torchfair.projection.course import Course, Outcome, Standing
from torchfair.projection.damping import Damping

SETTINGS = ProjectionSettings(merit_tolerance=1e-6, patience=3)
TAKEN = Outcome(Damping(1.0), gain=1.0, size=1.0, short=False, accepted=True)
REFUSED = Outcome(Damping(1.0), gain=0.0, size=1e-12, short=True, accepted=False)


def start() -> Course:
    return Course(Standing(merit=1.0, gradient=0.5, floor=0.0), Damping(1.0), accuracy=1e-2)


def after_falls(course: Course, *falls: float) -> Course:
    """After steps that lower the merit by these fractions."""
    for fall in falls:
        standing = Standing(course.merit * (1.0 - fall), 0.5, 0.0)
        course = course.after(TAKEN, standing, SETTINGS, inexact=False)
    return course


def test_as_many_small_falls_as_patience_asks_for_are_rest() -> None:
    """Those before them, however large, do not count."""
    assert after_falls(start(), 0.5, 1e-8, 1e-8).suspicion is None
    assert after_falls(start(), 0.5, 1e-8, 1e-8, 1e-8).suspicion is Status.MERIT_TOLERANCE
    assert after_falls(start(), 1e-8, 1e-8, 1e-5, 1e-8, 1e-8).suspicion is None
    assert after_falls(start(), 2e-6, 1e-8, 1e-8).suspicion is None
    assert after_falls(start(), 9e-7, 9e-7, 9e-7).suspicion is Status.MERIT_TOLERANCE  # each of them


@pytest.mark.parametrize(("times", "ends"), [(1, 3), (2, 6), (4, 12)])
def test_small_falls_of_damped_steps_are_waited_for_longer_unless_runs_go_on(times: int, ends: int) -> None:
    settings = replace(SETTINGS, patience_when_damped=times, when_settled="stop", initial_damping=0.5)
    course, standing = start(), Standing(1.0 - 1e-9, 0.5, 0.0)
    for number in range(1, ends + 1):
        course = course.after(TAKEN, standing, settings, inexact=False)
        assert (course.suspicion is Status.MERIT_TOLERANCE) == (number == ends)
    lightly = replace(settings, initial_damping=1.0)  # not above its start
    course = start()
    for _ in range(3):
        course = course.after(TAKEN, standing, lightly, inexact=False)
    assert course.suspicion is Status.MERIT_TOLERANCE


def test_what_was_found_to_be_no_minimum_is_suspected_only_after_new_rest() -> None:
    doubtful = after_falls(start(), 1e-8, 1e-8, 1e-8).judged(certified=False, goes_on=True)
    assert doubtful.finished(SETTINGS) is None
    assert after_falls(doubtful, 1e-8, 1e-8).suspicion is None
    assert after_falls(doubtful, 1e-8, 1e-8, 1e-8).suspicion is Status.MERIT_TOLERANCE


def test_a_state_from_which_short_steps_are_refused_is_judged_once() -> None:
    """The answer would be the same; after a step that is taken the state is another one."""
    first = start().after(REFUSED, start().standing, SETTINGS, inexact=False)
    assert first.suspicion is Status.STEP_TOLERANCE
    going = first.judged(certified=False, goes_on=True)
    assert going.after(REFUSED, going.standing, SETTINGS, inexact=False).suspicion is None
    moved = after_falls(going, 0.1)
    assert moved.after(REFUSED, moved.standing, SETTINGS, inexact=False).suspicion is Status.STEP_TOLERANCE


SHORT = replace(TAKEN, gain=0.45, size=1e-16, short=True)


def after_steps(course: Course, *outcomes: Outcome, settings: ProjectionSettings = SETTINGS) -> Course:
    """After steps that leave nothing but doubt."""
    for outcome in outcomes:
        course = course.after(outcome, course.standing, settings, inexact=False)
        course = course.judged(certified=False, goes_on=True) if course.suspicion else course
    return course


def test_eight_idle_steps_in_a_row_are_the_end_if_it_is_no_minimum() -> None:
    """Damping need not be exhausted: steps that gain less than half of what they promise leave it as it is."""
    assert after_steps(start(), *[SHORT] * 7).status is None
    assert after_steps(start(), *[SHORT] * 8).status is Status.STALLED
    assert after_steps(start(), REFUSED, *[SHORT, REFUSED, REFUSED] * 2, SHORT).status is Status.STALLED
    assert after_steps(start(), *[SHORT] * 7, TAKEN, *[SHORT] * 7).status is None
    lower = Standing(start().merit * (1.0 - 1e-5), 0.5, 0.0)
    fallen = after_steps(start(), *[SHORT] * 7).after(SHORT, lower, SETTINGS, inexact=False)
    assert fallen.judged(certified=False, goes_on=True).status is None  # beside what is stiff they may be worth much
    refused = replace(REFUSED, short=False)
    assert after_steps(start(), *[SHORT] * 7, refused, *[SHORT] * 7).status is None
    course = after_steps(start(), *[SHORT] * 7).after(SHORT, start().standing, SETTINGS, inexact=False)
    assert course.judged(certified=True, goes_on=True).status is Status.STEP_TOLERANCE


def test_idle_steps_are_no_end_while_the_damping_falls() -> None:
    """From far too much of it the first steps are short and lower nothing."""
    falling = [replace(SHORT, damping=Damping(1e9 / 3.0**number)) for number in range(20)]
    assert after_steps(start(), *falling).status is None
    assert after_steps(start(), *falling[::-1]).status is Status.STALLED


def test_where_every_step_is_taken_short_ones_are_no_end() -> None:
    settings = replace(SETTINGS, step_policy="every")
    assert after_steps(start(), *[SHORT] * 20, settings=settings).status is None


@pytest.mark.parametrize("gain", [1.0, 1.5, 1e150])
def test_damping_falls_to_a_third_however_much_a_step_gains(gain: float) -> None:
    assert Damping(6.0).accepted(gain).value == pytest.approx(2.0)

"""Steppers at rest that decide themselves how far each step goes, and when the last one is taken."""

from __future__ import annotations

from pdsolve.steppers.fatigue_steps import FatigueSteps
from pdsolve.steppers.path_steps import PathSteps

SteppedRest = FatigueSteps | PathSteps

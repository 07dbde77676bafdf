"""Robots in simulation, with and without defects, as labelled runs."""

from scenarios.errors import (
    MissingSimulatorError,
    ScenarioError,
    SimulationError,
    UnknownScenarioError,
    UnsimulatedRobotError,
    UnsuitedScenarioError,
    UnsupportedModelError,
)
from scenarios.robots import ROBOTS, Arm
from scenarios.simulation import simulate
from scenarios.table import SCENARIOS, Scenario

__all__ = [
    "ROBOTS",
    "SCENARIOS",
    "Arm",
    "MissingSimulatorError",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "UnknownScenarioError",
    "UnsimulatedRobotError",
    "UnsuitedScenarioError",
    "UnsupportedModelError",
    "simulate",
]

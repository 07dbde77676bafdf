"""Labelled runs of simulated robots, with and without defects."""

from scenarios.errors import (
    ChangedRunError,
    DatasetError,
    MissingSimulatorError,
    SampleError,
    ScenarioError,
    SimulationError,
    UnknownScenarioError,
    UnsimulatedRobotError,
    UnsuitedScenarioError,
    UnsupportedModelError,
)
from scenarios.reproduction import reproduce
from scenarios.robots import ROBOTS
from scenarios.sample import Sample
from scenarios.simulation import simulate
from scenarios.table import SCENARIOS, Scenario

__all__ = [
    "ROBOTS",
    "SCENARIOS",
    "ChangedRunError",
    "DatasetError",
    "MissingSimulatorError",
    "Sample",
    "SampleError",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "UnknownScenarioError",
    "UnsimulatedRobotError",
    "UnsuitedScenarioError",
    "UnsupportedModelError",
    "reproduce",
    "simulate",
]

"""Labelled runs of simulated robots, with and without defects."""

from noiseclassifier.scenarios.errors import (
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
from noiseclassifier.scenarios.reproduction import reproduce
from noiseclassifier.scenarios.robots import ROBOTS
from noiseclassifier.scenarios.sample import Sample
from noiseclassifier.scenarios.simulation import simulate
from noiseclassifier.scenarios.table import SCENARIOS, Scenario

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

"""Labelled runs of simulated robots, with and without defects."""

from noiseclassifier.scenarios.errors import DatasetError, ScenarioError, SimulationError
from noiseclassifier.scenarios.robots import ROBOTS
from noiseclassifier.scenarios.simulation import reproduce, simulate
from noiseclassifier.scenarios.table import SCENARIOS, Scenario

__all__ = [
    "ROBOTS",
    "SCENARIOS",
    "DatasetError",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "reproduce",
    "simulate",
]

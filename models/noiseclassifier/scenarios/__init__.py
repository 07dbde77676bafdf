"""Labelled runs of simulated robots, with and without defects."""

from noiseclassifier.scenarios.motions import DatasetError, ScenarioError, SimulationError
from noiseclassifier.scenarios.robots import ROBOTS
from noiseclassifier.scenarios.simulation import SCENARIOS, Scenario, simulate

__all__ = [
    "ROBOTS",
    "SCENARIOS",
    "DatasetError",
    "Scenario",
    "ScenarioError",
    "SimulationError",
    "simulate",
]

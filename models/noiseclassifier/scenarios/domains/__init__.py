"""Wide domains: runs of many robots, drives, sensors, controllers and motions, drawn by a seed."""

from noiseclassifier.scenarios.domains.distribution import DISTRIBUTION, Distribution
from noiseclassifier.scenarios.domains.domain import Domain, Logger
from noiseclassifier.scenarios.domains.logs import logged
from noiseclassifier.scenarios.domains.simulation import FIRST, GOOD, RECIPE, faults_of, simulate

__all__ = [
    "DISTRIBUTION",
    "FIRST",
    "GOOD",
    "RECIPE",
    "Distribution",
    "Domain",
    "Logger",
    "faults_of",
    "logged",
    "simulate",
]

"""Wide domains: runs of many robots, drives, sensors, controllers and motions, drawn by a seed."""

from scenarios.domains.distribution import DISTRIBUTION, Distribution
from scenarios.domains.domain import Domain, Logger
from scenarios.domains.logs import logged
from scenarios.domains.simulation import FIRST, GOOD, RECIPE, faults_of, simulate

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

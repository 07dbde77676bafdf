"""Defects that scale with the size of the robot."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from noiseclassifier.scenarios.defects.plan import Plan
from noiseclassifier.scenarios.faults import Faults


@dataclass(frozen=True)
class Scaled:
    """A defect with settings in the units of the robot."""

    defect: Any
    units: Mapping[str, str]

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults of one run, their sizes multiplied by the robot's units."""
        settings = {
            name: tuple(getattr(plan.units, unit) * value for value in getattr(self.defect, name))
            for name, unit in self.units.items()
        }
        faults: Faults = replace(self.defect, **settings).draw(rng, plan)
        return faults

"""The parts of a data set, without numpy: `inspector --help` imports this module."""

from enum import StrEnum


class Part(StrEnum):
    """A part of a data set; a hash decides what is in `test`, see ``noiseclassifier.held_out``."""

    ALL = "all"
    TRAINING = "training"
    TEST = "test"

    def has(self, *, held_out: bool) -> bool:
        """Whether a recording belongs to this part.

        Args:
            held_out: Result of ``noiseclassifier.held_out`` for its group.
        """
        return self is Part.ALL or held_out == (self is Part.TEST)


class By(StrEnum):
    """What the runs of an evaluation are grouped by."""

    ROBOT = "robot"
    DOMAIN = "domain"
    SCENARIO = "scenario"

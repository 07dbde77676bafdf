"""Which recordings of a data set are meant."""

from enum import StrEnum


class Part(StrEnum):
    """The part of a data set; `test` is fixed by hash, see ``models.held_out``."""

    ALL = "all"
    TRAINING = "training"
    TEST = "test"

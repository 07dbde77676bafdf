"""A verdict whose every field is known, for tests of what is read back."""

from pathlib import Path

from inspector.errors import Status, Unknown
from inspector.localisation import Localisation
from inspector.localisation.order import Order
from inspector.verdict import Beside, Evidence, Finding, Missing, Verdict

FOUND = Localisation("measured", "desired", 0.01, joints=(("a", 0.7), ("b", 0.3)), band=(9, 30))
KNOWN = Evidence("repetitions", 24.0, 1.1, "a", "velocity", (16.0, 32.0), -20.0)
WHOLE = Verdict(
    Path("pick-1.npz"), Status.FINDINGS, "general",
    (
        Finding("impact", 1.0, 1.5, 0.9, False, Localisation(), evidence=KNOWN),
        Finding("oscillations", 2.0, 3.0, 0.8, True, FOUND, Order("b", 3.0)),
    ),
    "a message", Unknown.IGNORE, "f" * 64,
    Beside(
        "reference", ("pick",), 3, {"repetitions": 1.0}, {"repetitions": 4.0}, 9.0, {"a": 9.0},
        failures=(("end of the run", "1.0 of 2.0 s"),), words="100% by 3 repetitions of pick",
    ),
    assumed="assumed", scenario="walk", duration=4.5, rate=1000.0, joints=6, seconds=0.25,
    missing=(Missing("impact", 1.1, 1.3, "the pick"),), picture=Path("pick.png"), begin=1.5,
)  # fmt: skip

"""What one run draws: its domain, and what a logger makes of it."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias

Control: TypeAlias = Literal["pd", "computed-torque", "impedance", "policy"]
Velocity: TypeAlias = Literal["measured", "filtered", "differentiated"]
Desired: TypeAlias = Literal["commanded", "planned", "zero", "missing"]
Effort: TypeAlias = Literal["missing", "torque", "current"]

TARGET_CONTROL: Control = "impedance"
"""Control that is never learnt from."""
TARGET_BITS = 13
"""Encoders of so many bits or fewer are never learnt from, in any kind of log."""
TARGET_HOLD = 4
"""Logs whose samples are held so many times or more are never learnt from."""


@dataclass(frozen=True, kw_only=True)
class Domain:
    """Body, drives and control of one run; scales multiply the robot's nominal values.

    Attributes:
        flexibility: Natural frequency of the rotors on their elastic gears, in [Hz]; 0 if rigid.
        backlash: Free play of the gears, in [rad].
        torque_rise: Time from no torque to the limit, in [s].
        delay: From a reading to its torque, in [s].
        policy_rate: Rate of the targets of a policy, held in between, in [Hz]; 0 for none.
        encoder_bandwidth: Of the velocities in the loop, in [Hz].
    """

    wildness: float
    length: float
    mass: float
    payload: float
    gear: float
    ripple: float
    flexibility: float
    backlash: float
    cogging: float
    stiction: float
    friction: float
    viscous: float
    rotor: float
    torque_limit: float
    torque_rise: float
    delay: float
    control: Control
    stiffness: float
    damping: float
    feedforward: float
    policy_rate: float
    encoder_bits: int
    encoder_bandwidth: float

    @property
    def name(self) -> str:
        """Name of the domain in evaluations: the simulator and the kind of control."""
        return f"mujoco-{self.control}"

    @property
    def target(self) -> bool:
        """Whether it lies in a part of the distribution that is never learnt from."""
        return self.control == TARGET_CONTROL

    def as_dict(self) -> dict[str, Any]:
        """All values, with the name."""
        return {"name": self.name, **asdict(self)}

    def __str__(self) -> str:
        return _lines(self.as_dict())


@dataclass(frozen=True, kw_only=True)
class Logger:
    """Sensing and logging of one run.

    Attributes:
        rate: Sample rate, in [Hz].
        cutoff: Of the low-pass, in [Hz].
        noise: Standard deviation of the white noise of velocities, in [rad/s].
        resonances: Frequencies that the ripple excites, in [Hz].
        current: Current of a motor at the torque limit, in [A]; 0 unless it is logged.
    """

    rate: float
    velocity: Velocity
    bits: int
    cutoff: float
    noise: float
    jitter: float
    lost: float
    repeated: float
    hold: int
    ripple: float
    roughness: float
    gear: float
    resonances: tuple[float, ...]
    desired: Desired
    effort: Effort = "missing"
    current: float = 0.0
    effort_noise: float = 0.0
    effort_bits: int = 16

    @property
    def target(self) -> bool:
        """Whether it lies in a part of the distribution that is never learnt from."""
        return self.bits <= TARGET_BITS or self.hold >= TARGET_HOLD

    def as_dict(self) -> dict[str, Any]:
        """All values."""
        return asdict(self)

    def __str__(self) -> str:
        return _lines(self.as_dict())


def _lines(values: dict[str, Any]) -> str:
    def text(value: Any) -> str:
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    return "\n".join(f"{name:18}{text(value)}" for name, value in values.items())

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
        wildness: From 0, a robot near its nominal values, to 1, the far ends of all ranges.
        length: Scale of all lengths.
        mass: Scale of all masses.
        payload: Mass that the controller has no model of, as a multiple of the robot's nominal.
        gear: Ratio of the gears.
        ripple: Velocity ripple of the gears, as a share of the joint's speed.
        flexibility: Natural frequency of the rotors on their elastic gears, in [Hz]; 0 if rigid.
        backlash: Free play of the gears, in [rad].
        cogging: Torque of the magnets' cogging, as a share of the torque limit.
        stiction: Static friction, as a multiple of the Coulomb friction.
        friction: Scale of the Coulomb friction.
        viscous: Scale of the viscous friction.
        rotor: Scale of the rotors' inertia.
        torque_limit: Scale of the torque limits.
        torque_rise: Time from no torque to the limit, in [s].
        delay: From a reading to its torque, in [s].
        control: Kind of control.
        stiffness: Scale of the position gains.
        damping: Scale of the velocity gains.
        feedforward: Share of the model's torque that is fed forward.
        policy_rate: Rate of the targets of a policy, held in between, in [Hz]; 0 for none.
        encoder_bits: Counts per turn of the encoders in the loop, as a power of two.
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
        velocity: How velocities come about: measured, low-pass filtered, or differentiated from
            encoder counts and low-pass filtered.
        bits: Counts per turn of the logged encoders, as a power of two.
        cutoff: Of the low-pass, in [Hz].
        noise: Standard deviation of the white noise of velocities, in [rad/s].
        jitter: Standard deviation of the stamps, as a share of the sample time.
        lost: Share of lost samples, between which velocities are interpolated.
        repeated: Share of samples that repeat the one before.
        hold: Samples for which each one is held; 1 for none.
        ripple: Velocity ripple, as a share of the joint's speed.
        roughness: Standard deviation of broadband noise, as a share of the joint's speed.
        gear: Ratio of the gears, to which the ripple is locked.
        resonances: Frequencies that the ripple excites, in [Hz].
        desired: What the desired velocities are: those that the drives follow (with feedback),
            those of the plan (smooth), zeros, or none.
        effort: What the efforts are: none, torques of the drives, or currents of their motors.
        current: Current of a motor at the torque limit, in [A]; 0 unless it is logged.
        effort_noise: Standard deviation of the white noise of efforts, as a share of the limit.
        effort_bits: Steps from minus to plus the limit, as a power of two.
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

"""The distribution that domains and loggers are drawn from."""

from dataclasses import dataclass, field, fields
from math import isfinite
from typing import Any, TypeAlias, get_args

import numpy as np

from noiseclassifier.scenarios.domains.domain import Control, Desired, Domain, Logger, Velocity
from noiseclassifier.scenarios.errors import ScenarioError
from noiseclassifier.scenarios.limits import Limits

Ends: TypeAlias = tuple[float, float]
"""Mild end and wild end of a range."""

RESONANCES = 2
"""Most resonances of one robot."""
PRESENT = 0.5
"""Share of the robots that have a given imperfection of gears at all."""
CURRENTS = 0.5
"""Share of the logs with efforts whose efforts are currents."""
RATES = (100.0, 125.0, 200.0, 250.0, 500.0, 1000.0, 1000.0, 1000.0, 2000.0, 5000.0, 10_000.0)
"""Rates of loggers, in [Hz], each drawn as often as it is listed."""


class DistributionError(ScenarioError):
    """A distribution out of range."""

    def __init__(self, name: str, ends: Any, problem: str) -> None:
        self.name, self.ends = name, ends
        super().__init__(f"distribution: {name} {ends}: {problem}")


def _about(unit: str, text: str, source: str, within: Ends, *, log: bool = False) -> dict[str, Any]:
    return {"unit": unit, "text": text, "source": source, "within": within, "log": log}


_OWN = "our choice"
_PANDA = "real Panda's log"
_REAL = "real logs"


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """Ranges of what domains and loggers draw, from their mild to their wild ends.

    Each run draws its wildness, uniform from 0 to 1, and each value uniform (or uniform in its
    logarithm) between the mild end and the point so far on the way to the wild end.
    """

    length: Ends = field(
        default=(1.0, 1.15),
        metadata=_about("", "lengths of links; or its inverse", _OWN, (1.0, 1.3)),
    )
    mass: Ends = field(
        default=(1.0, 1.3), metadata=_about("", "masses of links; or its inverse", _OWN, (1.0, 2.0))
    )
    payload: Ends = field(
        default=(0.0, 2.0),
        metadata=_about(
            "", "unknown payload, of the robot's nominal", "payload x 2 raised alarms", (0.0, 5.0)
        ),
    )
    gear: Ends = field(
        default=(30.0, 160.0),
        metadata=_about(
            "",
            "ratio of the gears, at any wildness",
            "orders 160 to 480 per turn in the real Panda",
            (1.0, 1000.0),
            log=True,
        ),
    )
    ripple: Ends = field(
        default=(0.0005, 0.03),
        metadata=_about(
            "",
            "velocity ripple by joint speed",
            f"{_PANDA}: 3 to 5 mrad/s per joint",
            (0.0, 0.1),
            log=True,
        ),
    )
    resonance: Ends = field(
        default=(15.0, 200.0),
        metadata=_about(
            "Hz", "resonances that ripple excites, at any wildness", _PANDA, (1.0, 1000.0), log=True
        ),
    )
    flexibility: Ends = field(
        default=(80.0, 15.0),
        metadata=_about(
            "Hz",
            "rotors on elastic gears, natural frequency",
            "Spong 1987: harmonic drives of arms 10 to 50 Hz",
            (5.0, 200.0),
            log=True,
        ),
    )
    backlash: Ends = field(
        default=(0.0, 0.002),
        metadata=_about(
            "rad", "free play of gears", "planetary gears: 1 to 10 arcmin", (0.0, 0.02)
        ),
    )
    cogging: Ends = field(
        default=(0.0, 0.01),
        metadata=_about(
            "", "cogging torque by torque limit", "motors' data sheets: below 2 %", (0.0, 0.1)
        ),
    )
    stiction: Ends = field(
        default=(1.0, 1.6),
        metadata=_about(
            "", "static by Coulomb friction", "Armstrong-Helouvry et al. 1994", (1.0, 3.0)
        ),
    )
    friction: Ends = field(
        default=(1.0, 3.0),
        metadata=_about("", "Coulomb friction; or its inverse", _OWN, (1.0, 10.0), log=True),
    )
    viscous: Ends = field(
        default=(1.0, 3.0),
        metadata=_about("", "viscous friction; or its inverse", _OWN, (1.0, 10.0), log=True),
    )
    rotor: Ends = field(
        default=(1.0, 2.0),
        metadata=_about("", "inertia of rotors; or its inverse", _OWN, (1.0, 4.0), log=True),
    )
    torque_limit: Ends = field(
        default=(1.0, 0.6), metadata=_about("", "torque limits", _OWN, (0.2, 2.0))
    )
    torque_rise: Ends = field(
        default=(0.0005, 0.01),
        metadata=_about(
            "s",
            "from no torque to the limit",
            "current loops of 100 to 1000 Hz",
            (0.0001, 0.1),
            log=True,
        ),
    )
    delay: Ends = field(
        default=(0.0002, 0.01),
        metadata=_about(
            "s",
            "from a reading to its torque",
            "field buses and drives: 0 to 10 ms",
            (0.0, 0.05),
            log=True,
        ),
    )
    stiffness: Ends = field(
        default=(1.3, 0.05),
        metadata=_about(
            "",
            "position gains",
            f"tracking errors of 0.02 to 3 rad/s in {_REAL}",
            (0.005, 3.0),
            log=True,
        ),
    )
    damping: Ends = field(
        default=(1.2, 0.2),
        metadata=_about(
            "", "velocity gains by the root of the stiffness", _OWN, (0.02, 3.0), log=True
        ),
    )
    feedforward: Ends = field(
        default=(1.0, 0.5), metadata=_about("", "share of the model's torque", _OWN, (0.0, 1.0))
    )
    policy_rate: Ends = field(
        default=(200.0, 50.0),
        metadata=_about(
            "Hz", "targets of policies", "learnt policies: 50 to 200 Hz", (10.0, 1000.0), log=True
        ),
    )
    loop_bits: Ends = field(
        default=(21.0, 16.0),
        metadata=_about("bit", "encoders in the loop", "data sheets of drives", (10.0, 26.0)),
    )
    loop_bandwidth: Ends = field(
        default=(700.0, 60.0),
        metadata=_about(
            "Hz", "velocities in the loop", "drives filter at 20 to 700 Hz", (5.0, 2000.0), log=True
        ),
    )
    bits: Ends = field(
        default=(23.0, 12.0),
        metadata=_about(
            "bit", "encoders of the log", "0.024 rad/s steps in a real log", (8.0, 30.0)
        ),
    )
    cutoff: Ends = field(
        default=(700.0, 20.0),
        metadata=_about(
            "Hz",
            "low-pass of the log's velocities",
            f"20 to 100 Hz in {_REAL}",
            (1.0, 5000.0),
            log=True,
        ),
    )
    noise: Ends = field(
        default=(0.0001, 0.02),
        metadata=_about(
            "rad/s",
            "white noise of velocities",
            f"up to 20 mrad/s in {_REAL}",
            (0.0, 0.5),
            log=True,
        ),
    )
    log_ripple: Ends = field(
        default=(0.0005, 0.02),
        metadata=_about(
            "",
            "velocity ripple of a log by joint speed, at any wildness",
            f"{_PANDA}: 0.5 to 1.3 % at the strongest order",
            (0.0, 0.1),
            log=True,
        ),
    )
    roughness: Ends = field(
        default=(0.0001, 0.005),
        metadata=_about(
            "",
            "broadband noise by joint speed",
            f"{_PANDA}, between its orders",
            (0.0, 0.1),
            log=True,
        ),
    )
    jitter: Ends = field(
        default=(0.0, 0.2),
        metadata=_about("", "stamps, by sample time", f"{_PANDA} has jittering stamps", (0.0, 0.5)),
    )
    lost: Ends = field(default=(0.0, 0.01), metadata=_about("", "lost samples", _REAL, (0.0, 0.2)))
    repeated: Ends = field(
        default=(0.0, 0.02), metadata=_about("", "repeated samples", _REAL, (0.0, 0.5))
    )
    hold: Ends = field(
        default=(1.0, 10.0),
        metadata=_about(
            "",
            "samples held by the driver",
            "one driver repeats about ten times",
            (1.0, 50.0),
            log=True,
        ),
    )

    effort_share: Ends = field(
        default=(0.6, 0.6),
        metadata=_about("", "share of the logs with efforts", _OWN, (0.0, 1.0)),
    )
    current: Ends = field(
        default=(2.0, 40.0),
        metadata=_about(
            "A",
            "motors' current at the torque limit, at any wildness",
            "data sheets of servos, UR arms, legs' drives",
            (0.1, 1000.0),
            log=True,
        ),
    )
    effort_noise: Ends = field(
        default=(0.0003, 0.01),
        metadata=_about("", "white noise of efforts by limit", _OWN, (0.0, 0.2), log=True),
    )
    effort_bits: Ends = field(
        default=(16.0, 9.0),
        metadata=_about(
            "bit", "efforts from limit to limit", "converters of drives: 10 to 16 bit", (6.0, 30.0)
        ),
    )

    def __post_init__(self) -> None:
        """Check all ranges."""
        for each in fields(self):
            ends, (least, most) = getattr(self, each.name), each.metadata["within"]
            if not (isinstance(ends, tuple) and len(ends) == 2):
                raise DistributionError(each.name, ends, "expected a mild and a wild end")
            if not all(isfinite(end) and least <= end <= most for end in ends):
                unit = f" {each.metadata['unit']}" if each.metadata["unit"] else ""
                problem = f"expected within {least:g} to {most:g}{unit}"
                raise DistributionError(each.name, ends, problem)

    def domain(self, rng: np.random.Generator, limits: Limits) -> Domain:
        """Draw the domain of one run."""
        draw = _Draw(self, rng, float(rng.uniform()))
        control: Control = str(rng.choice(get_args(Control)))  # type: ignore[assignment]
        stiffness = draw("stiffness")
        if control == "impedance":  # soft by definition
            stiffness = min(stiffness, draw.far("stiffness"))
        stiffness = float(np.clip(stiffness, *limits.stiffness))
        damping = float(np.clip(draw("damping") * np.sqrt(stiffness), *limits.damping))
        elastic = draw.present()
        return Domain(
            wildness=draw.wildness,
            length=draw.either("length"),
            mass=draw.either("mass"),
            payload=draw("payload"),
            gear=draw.far("gear"),
            ripple=draw("ripple") if elastic else 0.0,
            flexibility=max(draw("flexibility"), limits.flexibility) if elastic else 0.0,
            backlash=draw("backlash") if elastic and draw.present() else 0.0,
            cogging=draw("cogging") if draw.present() else 0.0,
            stiction=draw("stiction") if draw.present() else 1.0,
            friction=draw.either("friction"),
            viscous=draw.either("viscous"),
            rotor=draw.either("rotor"),
            torque_limit=draw("torque_limit"),
            torque_rise=draw("torque_rise"),
            delay=min(draw("delay"), limits.delay),
            control=control,
            stiffness=stiffness,
            damping=damping,
            feedforward=max(draw("feedforward"), limits.feedforward) if control == "pd" else 1.0,
            policy_rate=max(draw("policy_rate"), 1 / limits.hold) if control == "policy" else 0.0,
            encoder_bits=round(draw("loop_bits")),
            encoder_bandwidth=draw("loop_bandwidth"),
        )

    def logger(
        self,
        rng: np.random.Generator,
        domain: Domain,
        *,
        most: float,
        rate: float | None = None,
    ) -> Logger:
        """Draw the logger of one run.

        Args:
            most: Highest rate, that of the run, in [Hz].
            rate: The rate, in place of one that is drawn, in [Hz].
        """
        draw = _Draw(self, rng, domain.wildness)
        drawn = float(rng.choice([each for each in RATES if each <= most * (1 + 1e-6)]))
        rate = rate or drawn
        held = rng.uniform() < 0.1
        # Of another generator, so that it changes nothing else.
        efforts = _Draw(self, rng.spawn(1)[0], domain.wildness)
        return Logger(
            rate=rate,
            velocity=str(rng.choice(get_args(Velocity))),  # type: ignore[arg-type]
            bits=round(draw("bits")),
            cutoff=min(draw("cutoff"), 0.4 * rate),
            noise=draw("noise"),
            jitter=draw("jitter"),
            lost=draw("lost") if draw.present() else 0.0,
            repeated=draw("repeated") if draw.present() else 0.0,
            hold=max(1, round(draw.far("hold"))) if held else 1,
            ripple=draw.far("log_ripple"),
            roughness=draw("roughness"),
            gear=domain.gear,
            resonances=tuple(draw.far("resonance") for _ in range(rng.integers(RESONANCES + 1))),
            desired=str(  # type: ignore[arg-type]
                rng.choice(get_args(Desired), p=(0.5, 0.35, 0.08, 0.07))
            ),
            **efforts.effort(),
        )

    def __str__(self) -> str:
        rows = [
            (
                each.name,
                *(f"{end:g}" for end in getattr(self, each.name)),
                *(each.metadata[key] for key in ("unit", "text", "source")),
            )
            for each in fields(self)
        ]
        head = ("setting", "mild", "wild", "unit", "what", "source")
        return "\n".join(
            f"{name:16}{mild:>8}{wild:>8} {unit:6}{text:50}{source}"
            for name, mild, wild, unit, text, source in (head, *rows)
        )


class _Draw:
    """Values of one run."""

    def __init__(
        self, distribution: Distribution, rng: np.random.Generator, wildness: float
    ) -> None:
        self._distribution, self._rng, self.wildness = distribution, rng, wildness
        self._log = {each.name: each.metadata["log"] for each in fields(distribution)}

    def __call__(self, name: str) -> float:
        """A value between the mild end and the point on the way to the wild one."""
        return self._between(name, self.wildness * float(np.sqrt(self._rng.uniform())))

    def far(self, name: str) -> float:
        """A value between both ends, at any wildness."""
        return self._between(name, float(self._rng.uniform()))

    def either(self, name: str) -> float:
        """A value, or its inverse."""
        value = self(name)
        return value if self._rng.uniform() < 0.5 else 1 / value

    def present(self) -> bool:
        """Whether the robot has an imperfection."""
        return bool(self._rng.uniform() < PRESENT)

    def effort(self) -> dict[str, Any]:
        """What of efforts a logger has."""
        share, kind = self._rng.uniform(size=2).tolist()
        current, noise, bits = (self.far("current"), self("effort_noise"), self("effort_bits"))
        there, measured = share < self("effort_share"), kind >= CURRENTS
        return {
            "effort": ("torque" if measured else "current") if there else "missing",
            "current": 0.0 if measured or not there else current,
            "effort_noise": noise,
            "effort_bits": round(bits),
        }

    def _between(self, name: str, share: float) -> float:
        mild, wild = getattr(self._distribution, name)
        if self._log[name] and mild > 0 and wild > 0:
            return float(mild * (wild / mild) ** share)
        return float(mild + share * (wild - mild))


DISTRIBUTION = Distribution()
"""The distribution of all wide runs."""

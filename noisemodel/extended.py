"""The extended noise estimate: the sound power of every link, by its surface and its speed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from noisemodel.dipole import Dipole
from noisemodel.errors import NoiseModelError
from noisemodel.kinematics import CHUNK
from noisemodel.noise import DENSITY, SOUND_SPEED, Noise, check_positive, sound_power
from noisemodel.robot import Robot
from noisemodel.speed import check_kind, check_motion, chunk_speeds
from noisemodel.surface import Surface, check_surface
from noisemodel.types import Array, Real


def extended(
    robot: Robot,
    surface: Surface,
    q: Real,
    v: Real,
    kind: str = "paper",
    *,
    density: float = DENSITY,
    sound_speed: float = SOUND_SPEED,
    efficiency: float | Sequence[float] | Real | str = 1.0,
    rate: float | None = None,
    q_desired: Real | None = None,
    v_desired: Real | None = None,
) -> Noise:
    """Estimate the sound power that each link radiates.

    Args:
        robot: The robot.
        surface: Its surface.
        q: Configurations as Pinocchio has them, shape (samples, nq).
        v: Velocities as Pinocchio has them, shape (samples, nv).
        kind: How the mean speed of a surface is taken, see ``surface_speed``.
        density: Of the air, in [kg/m³].
        sound_speed: In [m/s].
        efficiency: Radiation efficiency: one for all links, one for each, shape (links,), or
            "dipole", that of a small body that oscillates, by its frequency (see
            ``noisemodel.dipole``). With the kind "normal" that is the physics; the motion that
            the other kinds see is filtered alike, so that they can be compared.
        rate: Sample rate, which only "dipole" needs, in [Hz].
        q_desired: Desired configurations, shape (samples, nq); ``q`` unless given.
        v_desired: Desired velocities, shape (samples, nv); the power of this motion is added.
            A floating base is stationary in it, whatever is given.

    Returns:
        The sound power of every link.

    Raises:
        UnknownKindError: If the kind does not exist.
        GeometryError: If the surface is that of another robot.
        CornerError: If a link is too small for "dipole" at this rate.
        MotionError: If ``q`` or ``v`` are of another shape than the robot's, or not finite.
        NoiseModelError: If a number is not positive, or lengths differ.
    """
    chunks = extended_chunks(
        robot,
        surface,
        q,
        v,
        kind,
        density=density,
        sound_speed=sound_speed,
        efficiency=efficiency,
        rate=rate,
        q_desired=q_desired,
        v_desired=v_desired,
    )
    power, stop = np.empty((len(surface.links), len(q))), 0
    for chunk in chunks:
        start, stop = stop, stop + len(chunk.power)
        power[:, start:stop] = chunk.power.T
    return Noise(power.T, surface.names, density, sound_speed)


def extended_chunks(
    robot: Robot,
    surface: Surface,
    q: Real,
    v: Real,
    kind: str = "paper",
    *,
    density: float = DENSITY,
    sound_speed: float = SOUND_SPEED,
    efficiency: float | Sequence[float] | Real | str = 1.0,
    rate: float | None = None,
    q_desired: Real | None = None,
    v_desired: Real | None = None,
    chunk: int = CHUNK,
) -> Iterator[Noise]:
    """Estimate the sound power that each link radiates chunk by chunk, in little memory.

    Chunks put together are what ``extended`` returns, however long they are.

    Args:
        robot: See ``extended``, as for all but the last.
        surface: See ``extended``.
        q: See ``extended``.
        v: See ``extended``.
        kind: See ``extended``.
        density: See ``extended``.
        sound_speed: See ``extended``.
        efficiency: See ``extended``.
        rate: See ``extended``.
        q_desired: See ``extended``.
        v_desired: See ``extended``.
        chunk: Samples in each chunk but the last.

    Returns:
        The noise of one chunk after the other; each is computed when it is taken.

    Raises:
        UnknownKindError: If the kind does not exist.
        GeometryError: If the surface is that of another robot.
        CornerError: If a link is too small for "dipole" at this rate.
        MotionError: If ``q`` or ``v`` are of another shape than the robot's, or not finite.
        NoiseModelError: If a number is not positive, or lengths differ.
    """
    check_kind(kind)
    check_surface(surface, robot)
    check_motion(robot, q, v)
    check_positive("density", density, "kg/m³")
    check_positive("sound_speed", sound_speed, "m/s")
    check_positive("chunk", chunk, "samples")

    def motion(q: Real, v: Real, *, base_stationary: bool = False) -> _Motion:
        if not isinstance(efficiency, str):
            return _Motion(q, v, None, base_stationary)
        if efficiency != "dipole":
            raise NoiseModelError(f"efficiency is {efficiency!r}, expected numbers or 'dipole'")
        if rate is None:
            raise NoiseModelError("efficiency 'dipole' needs the rate of the samples, in Hz")
        check_positive("rate", rate, "Hz")
        return _Motion(q, v, Dipole(surface, rate=rate, sound_speed=sound_speed), base_stationary)

    motions = [motion(q, v)]
    if v_desired is not None:
        wanted = q if q_desired is None else q_desired
        check_motion(robot, wanted, v_desired, names=("q_desired", "v_desired"))
        if len(v_desired) != len(v):
            raise NoiseModelError(f"v has {len(v)} samples, v_desired {len(v_desired)}")
        motions.append(motion(wanted, v_desired, base_stationary=robot.floating_base))
    elif q_desired is not None:
        raise NoiseModelError(
            "q_desired is given and v_desired is not; positions alone radiate nothing"
        )
    efficiencies = _efficiencies(efficiency, surface)

    def chunks() -> Iterator[Noise]:
        for start in range(0, len(q), chunk):
            part = slice(start, start + chunk)
            first, *more = (one.speeds(robot, surface, part, kind) ** 2 for one in motions)
            power = sound_power(
                sum(more, first),
                surface.area[:, None],
                efficiency=efficiencies[:, None],
                density=density,
                sound_speed=sound_speed,
            )
            yield Noise(power.T, surface.names, density, sound_speed)

    return chunks()


@dataclass(frozen=True, eq=False)
class _Motion:
    """A motion that makes noise.

    Attributes:
        q: Configurations, shape (samples, nq).
        v: Velocities, shape (samples, nv).
        dipole: The filter that it passes, or None.
        base_stationary: Whether the velocities of the floating base count as 0.
    """

    q: Real
    v: Real
    dipole: Dipole | None
    base_stationary: bool

    def speeds(self, robot: Robot, surface: Surface, part: slice, kind: str) -> Array:
        v = self.v[part]
        if self.base_stationary:
            v = np.hstack((np.zeros((len(v), 6)), v[:, 6:]))
        return chunk_speeds(robot, surface, self.q[part], v, kind, self.dipole)


def _efficiencies(efficiency: float | Sequence[float] | Real | str, surface: Surface) -> Array:
    """Spell out the efficiency of each link, shape (links,); that of "dipole" is in the motion."""
    if isinstance(efficiency, str):
        return np.ones(len(surface.links))
    each = np.asarray(efficiency, dtype=np.float64)
    if each.shape not in ((), (len(surface.links),)):
        raise NoiseModelError(
            f"efficiency has shape {each.shape}, expected one number or ({len(surface.links)},)"
        )
    if not ((each > 0.0) & (each < np.inf)).all():
        raise NoiseModelError(f"efficiency is {each.min():g}, expected positive numbers")
    return np.broadcast_to(each, len(surface.links))

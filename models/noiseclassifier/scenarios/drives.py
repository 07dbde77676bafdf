"""Drives of a robot: from encoder readings to velocities and torques."""

from collections import deque

import numpy as np

from noiseclassifier.scenarios.domains import Domain
from noiseclassifier.scenarios.faults import NO_DRIVE_FAULT, DriveFault, Imperfections
from noiseclassifier.scenarios.motions import RATE, STEP, STEPS, TICK, Rng, times
from noiseclassifier.scenarios.robots import Drivetrain
from noisemodel.types import Array


def tracking_gains(bandwidth: float, step: float) -> tuple[float, float]:
    """Gains of the critically damped alpha-beta filter that estimates velocities from an encoder.

    At 10 kHz, differences of encoder counts would mask every motion; servo drives track their
    encoders instead, and correct by a share of the innovation; both poles lie at exp(-2 pi f step).
    """
    pole = float(np.exp(-2 * np.pi * bandwidth * step))
    return 1 - pole**2, (1 - pole) ** 2 / step


class Drives:
    """The drives of all joints, sample by sample, from positions and encoder errors at rest."""

    def __init__(
        self, start: Array, drivetrain: Drivetrain, offset: Array, imperfections: Imperfections
    ) -> None:
        self._stiffness = np.array(drivetrain.stiffness) * imperfections.stiffness
        self._damping = np.array(drivetrain.damping) * imperfections.damping
        self._limit = np.array(drivetrain.torque)
        self._least = -self._limit
        self._count = float(2 * np.pi / 2**imperfections.encoder_bits)
        self._alpha, self._beta = tracking_gains(imperfections.encoder_bandwidth, STEP)
        self._tracked, self._velocity = start + offset, np.zeros_like(start)
        self._waiting: deque[Array] = deque(
            [np.zeros_like(start)] * imperfections.torque_delay, imperfections.torque_delay
        )

    def read(self, position: Array, error: Array) -> tuple[Array, Array]:
        """Positions and velocities that drives report at true positions, with encoders' errors."""
        reading = np.rint((position + error) / self._count) * self._count
        predicted = self._tracked + STEP * self._velocity
        innovation = reading - predicted
        self._tracked = predicted + self._alpha * innovation
        self._velocity = self._velocity + self._beta * innovation
        return reading, self._velocity

    def command(self, targets: Array, rates: Array, torque: Array) -> tuple[Array, Array, Array]:
        """What the drives follow over one tick."""
        return targets, rates, torque

    def torque(
        self, position: Array, velocity: Array, desired: Array, rate: Array, feedforward: Array
    ) -> Array:
        """Torques that act now, after the delay: of the model, and by positions and velocities."""
        demanded = feedforward + self._stiffness * (desired - position)
        demanded += self._damping * (rate - velocity)
        return self._delayed(demanded)

    def measured(self, acting: Array) -> Array:
        """Torques that the drives measure while some act, shape (joints,), in [N m]: the same."""
        return acting

    def _delayed(self, demanded: Array) -> Array:
        """Torques demanded before the delay, within the limits."""
        acting = self._waiting.popleft()
        self._waiting.append(np.minimum(np.maximum(demanded, self._least), self._limit))
        return acting


LOAD_SHARE = 0.2  # share of the rotors' inertia that stays on the joint's side of an elastic gear
DAMPING_RATIO = 0.05  # of an elastic gear
STRIBECK = 0.05  # speed over which static friction decays to Coulomb friction, in [rad/s]
POLES = 7  # periods of cogging per turn of the motor
ORDERS = (1, 2)  # orders of the ripple, as multiples of the gear ratio


class DomainDrives(Drives):
    """The drives of all joints in a wide domain, with so many ticks before the recording.

    An elastic gear is a spring with free play between rotor and joint (Spong 1987), whose
    transmission error is locked to the rotor's angle, so that it shakes the joint at the orders
    of the gear. Friction beyond Coulomb's is Stribeck's (Armstrong-Helouvry et al. 1994).
    """

    def __init__(
        self,
        start: Array,
        drivetrain: Drivetrain,
        offset: Array,
        imperfections: Imperfections,
        *,
        domain: Domain,
        fault: DriveFault = NO_DRIVE_FAULT,
        settling: int,
        rng: Rng,
    ) -> None:
        super().__init__(start, drivetrain, offset, imperfections)
        joints, limit = len(start), self._limit
        self._domain, self._fault = domain, fault
        self._gains = self._stiffness, self._damping
        self._sample = -settling * STEPS
        self._begin = self._end = 2**62  # never
        if fault.event is not None:
            self._begin = round((fault.event.start - fault.lead) * RATE)
            self._end = round(fault.event.stop * RATE)
        self._added = np.zeros((0, joints))
        if fault.torque is not None:
            self._added = fault.torque(times(self._end - self._begin, STEP))
        self._outside: Array | float = 0.0
        self._changed, self._worn = bool(np.any(fault.offset)), bool(np.any(fault.wear))
        self._delay, self._further = imperfections.torque_delay, round(fault.delay * RATE)
        longest = 1 + self._delay + self._further
        self._demands: deque[Array] = deque([np.zeros(joints)] * longest, longest)
        self._acting = np.zeros(joints)
        self._slope = limit * (STEP / domain.torque_rise)
        self._period = round(1 / domain.policy_rate / TICK) if domain.policy_rate else 0
        self._phase = int(rng.integers(max(self._period, 1)))
        self._target = start.copy()
        self._tick = 0
        self._before = start.copy()  # the joints' positions of the sample before
        coulomb = np.array(drivetrain.friction) * imperfections.friction
        self._stiction = (domain.stiction - 1) * coulomb
        self._cogging = domain.cogging * limit
        self._teeth = domain.gear * POLES * np.ones(joints)
        self._teeth_phase = rng.uniform(0, 2 * np.pi, joints)
        orders = np.array(ORDERS) * domain.gear
        self._orders = orders[:, None]
        self._order_phase = rng.uniform(0, 2 * np.pi, (len(orders), joints))
        # A transmission error a sin(n q) makes a velocity of a n |qd|.
        self._error = domain.ripple / self._orders * rng.uniform(0.3, 1, (len(orders), joints))
        self._elastic = domain.flexibility > 0
        rotor = np.array(drivetrain.armature) / LOAD_SHARE  # what is left of it is the joint's
        self._rotor = (1 - LOAD_SHARE) * rotor
        natural = 2 * np.pi * domain.flexibility
        self._spring = self._rotor * natural**2
        self._loss = 2 * DAMPING_RATIO * self._rotor * natural
        self._angle, self._speed = start.copy(), np.zeros(joints)

    def command(self, targets: Array, rates: Array, torque: Array) -> tuple[Array, Array, Array]:
        """What the drives follow over one tick: after faults of commands, held by a policy."""
        tick, self._tick = self._tick, self._tick + 1
        if self._fault.command:
            time = self._sample * STEP + times(len(targets), STEP)
            targets, rates = self._fault.command(time, targets, rates)
        if not self._period:
            return targets, rates, self._domain.feedforward * torque
        if (tick + self._phase) % self._period == 0:
            # A policy has no feed-forward: its targets lie off by as much as the torque takes.
            stiffness, damping = self._gains
            self._target = targets[0] + (torque + damping * rates[0]) / stiffness
        held = np.tile(self._target, (len(targets), 1))
        return held, np.zeros_like(rates), 0 * torque

    def read(self, position: Array, error: Array) -> tuple[Array, Array]:
        """Readings of all encoders, which sit on the rotors."""
        self._joint = position
        if self._changed and self._sample >= self._begin:
            error = error + self._fault.offset
        return super().read(self._angle if self._elastic else position, error)

    def torque(
        self, position: Array, velocity: Array, desired: Array, rate: Array, feedforward: Array
    ) -> Array:
        """Torques on the joints."""
        inside = self._begin <= self._sample < self._end
        if self._sample == self._begin:
            stiffness, damping = self._gains
            self._stiffness = stiffness * self._fault.stiffness
            self._damping = damping * self._fault.damping
            if self._fault.bandwidth:
                self._alpha, self._beta = tracking_gains(self._fault.bandwidth, STEP)
        elif self._sample == self._end:
            self._stiffness, self._damping = self._gains
        motor = super().torque(position, velocity, desired, rate, feedforward)
        if inside:
            motor = motor * self._fault.power
        speed = self._speed if self._elastic else velocity
        motor = motor + self._cogging * np.sin(self._teeth * self._angle + self._teeth_phase)
        if self._worn and inside:
            shaken = np.sin(self._domain.gear * self._angle + self._teeth_phase)
            motor = motor + self._fault.wear * self._limit * shaken
        motor -= self._stiction * np.exp(-np.square(speed / STRIBECK)) * np.tanh(speed / 5e-3)
        added = self._added[self._sample - self._begin] if inside and len(self._added) else 0.0
        self._outside = added if self._fault.outside else 0.0
        self._sample += 1
        if not self._elastic:
            self._angle = position
            return np.asarray(motor + added)
        return np.asarray(self._through_gear(motor) + added)

    def measured(self, acting: Array) -> Array:
        """Torques between gears and joints, without what acts from outside."""
        return acting - self._outside

    def _delayed(self, demanded: Array) -> Array:
        """Torques demanded before the delay, within limits of torque and of its rate."""
        self._demands.appendleft(demanded)
        inside = self._begin <= self._sample < self._end
        late = self._delay + self._further * inside
        wanted = np.clip(self._demands[late], self._least, self._limit)
        change = np.clip(wanted - self._acting, -self._slope, self._slope)
        self._acting = np.asarray(self._acting + change)
        return self._acting

    def _through_gear(self, motor: Array) -> Array:
        """Torque of the gears on the joints; moves the rotors by one sample."""
        joint_speed = (self._joint - self._before) / STEP
        self._before = self._joint.copy()
        ripple = (self._error * np.sin(self._orders * self._angle + self._order_phase)).sum(axis=0)
        twist = self._angle + ripple - self._joint
        play = self._domain.backlash / 2
        if self._worn and self._begin <= self._sample < self._end:
            play += self._fault.backlash / 2
        gear = self._spring * (twist - np.clip(twist, -play, play))
        gear = gear + np.where(np.abs(twist) > play, self._loss * (self._speed - joint_speed), 0.0)
        self._speed = self._speed + STEP * (motor - gear) / self._rotor
        self._angle = self._angle + STEP * self._speed
        return np.asarray(gear)

"""The robots that can be loaded by name: those of example-robot-data and of MuJoCo Menagerie."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from types import MappingProxyType

from noisemodel.errors import RobotError, UnknownRobotError
from noisemodel.run import is_robot_file

MENAGERIE = "menagerie/"
"""What the names of MuJoCo Menagerie's robots begin with: menagerie/unitree_go2."""


@dataclass(frozen=True)
class Listed:
    """A robot of the list.

    Attributes:
        urdf: Path of its URDF, below the robots' folder of example-robot-data.
        floating_base: Whether it moves freely in space.
    """

    urdf: str
    floating_base: bool = False


FLOATING = {
    "a1": "a1_description/urdf/a1.urdf",
    "alexander": "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "anymal_kinova": "anymal_b_simple_description/robots/anymal-kinova.urdf",
    "b1": "b1_description/urdf/b1.urdf",
    "b1_z1": "b1_description/urdf/b1-z1.urdf",
    "bolt": "bolt_description/robots/bolt.urdf",
    "borinot": "borinot_description/urdf/borinot_flying_arm_2.urdf",
    "centauro": "centauro_description/urdf/centauro.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "g1_with_hands": "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
    "go1": "go1_description/urdf/go1.urdf",
    "go2": "go2_description/urdf/go2.urdf",
    "hector": "hector_description/robots/quadrotor_base.urdf",
    "hextilt": "hextilt_description/urdf/hextilt_flying_arm_5.urdf",
    "human": "human_description/robots/human.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "icub": "icub_description/robots/icub.urdf",
    "icub_reduced": "icub_description/robots/icub_reduced.urdf",
    "iris": "iris_description/robots/iris_simple.urdf",
    "iris_rotors": "iris_description/robots/iris.urdf",
    "laikago": "laikago_description/urdf/laikago.urdf",
    "pr2": "pr2_description/urdf/pr2.urdf",
    "quadruped": "quadruped_description/urdf/quadruped.urdf",
    "romeo": "romeo_description/urdf/romeo.urdf",
    "romeo_laas_small": "romeo_description/urdf/romeo_laas_small.urdf",
    "romeo_small": "romeo_description/urdf/romeo_small.urdf",
    "simple_humanoid": "simple_humanoid_description/urdf/simple_humanoid.urdf",
    "simple_humanoid_classical": "simple_humanoid_description/urdf/simple_humanoid_classical.urdf",
    "solo8": "solo_description/robots/solo.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "talos_box": "talos_data/robots/talos_reduced_box.urdf",
    "talos_corrected": "talos_data/robots/talos_reduced_corrected.urdf",
    "talos_full": "talos_data/robots/talos_full_v2.urdf",
    "talos_full_box": "talos_data/robots/talos_full_v2_box.urdf",
}
FIXED = {
    "alex_nub_hands": "alex_description/urdf/alex_nub_hands.urdf",
    "alex_psyonic_hands": "alex_description/urdf/alex_psyonic_hands.urdf",
    "alex_sake_hands": "alex_description/urdf/alex_sake_hands.urdf",
    "allegro_left_hand": "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "allegro_right_hand": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "asr_twodof": "asr_twodof_description/urdf/TwoDofs.urdf",
    "baxter": "baxter_description/urdf/baxter.urdf",
    "double_pendulum": "double_pendulum_description/urdf/double_pendulum.urdf",
    "double_pendulum_continuous": (
        "double_pendulum_description/urdf/double_pendulum_continuous.urdf"
    ),
    "double_pendulum_simple": "double_pendulum_description/urdf/double_pendulum_simple.urdf",
    "finger_edu": "finger_edu_description/robots/finger_edu.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "panda_collision": "panda_description/urdf/panda_collision.urdf",
    "so100": "so_arm_description/urdf/so100.urdf",
    "so101": "so_arm_description/urdf/so101.urdf",
    "talos_arm": "talos_data/robots/talos_left_arm.urdf",
    "tiago": "tiago_description/robots/tiago.urdf",
    "tiago_dual": "tiago_description/robots/tiago_dual.urdf",
    "tiago_no_hand": "tiago_description/robots/tiago_no_hand.urdf",
    "tiago_pro": "tiago_pro_description/robots/tiago_pro.urdf",
    "ur3": "ur_description/urdf/ur3_robot.urdf",
    "ur3_empty": "ur_description/urdf/ur3.urdf",
    "ur3_gripper": "ur_description/urdf/ur3_gripper.urdf",
    "ur3_limited": "ur_description/urdf/ur3_joint_limited_robot.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "ur5_gripper": "ur_description/urdf/ur5_gripper.urdf",
    "ur5_limited": "ur_description/urdf/ur5_joint_limited_robot.urdf",
    "ur10": "ur_description/urdf/ur10_robot.urdf",
    "ur10_limited": "ur_description/urdf/ur10_joint_limited_robot.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "z1": "z1_description/urdf/z1.urdf",
}
ROBOTS: Mapping[str, Listed] = MappingProxyType(
    dict(
        sorted(
            [(name, Listed(urdf, floating_base=True)) for name, urdf in FLOATING.items()]
            + [(name, Listed(urdf)) for name, urdf in FIXED.items()]
        )
    )
)
"""Name to URDF and floating base (the wheel of example-robot-data has data, no Python module)."""


def package_roots() -> tuple[Path, ...]:
    """Folders that the listed robots' ``package://`` addresses are searched in.

    Raises:
        RobotError: If example-robot-data is not installed.
    """
    try:
        share = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    except PackageNotFoundError as error:
        raise RobotError(
            "the listed robots need example-robot-data; `pip install example-robot-data`"
        ) from error
    data = share / "example-robot-data"
    return share, data, data / "robots"


def urdf_path(name: str) -> Path:
    """Find the URDF of a listed robot.

    Args:
        name: One of ``ROBOTS``.

    Raises:
        RobotError: If example-robot-data is not installed.
    """
    return package_roots()[-1] / ROBOTS[name].urdf


def is_name(name: str) -> bool:
    """Whether a text is a listed robot, or names one of MuJoCo Menagerie."""
    return name in ROBOTS or (name.startswith(MENAGERIE) and not is_robot_file(name))


def menagerie_names() -> dict[str, str]:
    """The robots of MuJoCo Menagerie, each with what it is; none without the package."""
    try:
        import mujoco_menagerie
    except ImportError:
        return {}
    return {MENAGERIE + robot.name: robot.category for robot in mujoco_menagerie.robots()}


def menagerie_path(name: str) -> Path:
    """Find the MJCF of a robot of MuJoCo Menagerie; the package downloads it at its first use.

    Args:
        name: ``menagerie/NAME`` for the robot alone, or ``menagerie/NAME/ENTRY`` for one of the
            other files that its folder has, such as ``scene``.

    Raises:
        RobotError: If mujoco-menagerie is not installed, or the robot cannot be downloaded.
        UnknownRobotError: If there is no such robot.
    """
    try:
        import mujoco_menagerie
    except ImportError as error:
        raise RobotError(
            f"{name}: the robots of MuJoCo Menagerie need its package;"
            " `pip install 'noise-inspector[menagerie]'`"
        ) from error
    folder, _, entry = name.removeprefix(MENAGERIE).partition("/")
    if MENAGERIE + folder not in menagerie_names():
        raise UnknownRobotError(name, menagerie_names())
    robot = mujoco_menagerie.get(folder)
    try:
        return Path(robot.xml(entry or robot.default_model))
    except mujoco_menagerie.DownloadError as error:
        raise RobotError(
            f"{name}: cannot be downloaded ({' '.join(str(error).split())});"
            " MENAGERIE_ROOT=path names a checkout to use instead"
        ) from error
    except (mujoco_menagerie.MenagerieError, OSError) as error:
        raise RobotError(f"{name}: {' '.join(str(error).split())}") from error

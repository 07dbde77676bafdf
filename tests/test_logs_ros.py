import numpy as np
import pytest
from checks import holds, memory_below, one_line
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from samplelogs import EPOCH, JOINTS, TIMES, Talk, joint_states, numbers, write_bag, write_mcap

from inspector import read_log
from inspector.errors import LogError
from inspector.logs.bags import STATE, STATES
from noisemodel import Robot

TALK, OLD = Talk(), Talk(ros1=True)
POSITION, VELOCITY, EFFORT = (numbers(seed=seed) for seed in range(3))


def bag(tmp_path, topics, *, talk=TALK, name="bag", **how):
    return write_bag(tmp_path / (f"{name}.bag" if talk.ros1 else name), talk, topics, **how)


def states(talk=TALK, **how):
    return joint_states(talk, position=POSITION, velocity=VELOCITY, effort=EFFORT, **how)


@pytest.mark.parametrize(
    ("talk", "how"),
    [
        (TALK, {"storage": "sqlite3"}), (TALK, {"storage": "sqlite3", "compression": "message"}),
        (TALK, {"storage": "mcap"}), (TALK, {"storage": "mcap", "compression": "storage"}),
        (TALK, {"storage": "mcap", "compression": "file"}),
        (OLD, {}), (OLD, {"compression": "lz4"}), (OLD, {"compression": "bz2"}),
    ],
)  # fmt: skip
def test_every_value_of_a_bag_is_read_bit_for_bit(tmp_path, talk, how):
    path = bag(tmp_path, {"/joint_states": states(talk)}, talk=talk, **how)
    for each in (path, *path.glob("*.mcap*"), *path.glob("*.db3*")):  # a single file is enough
        run = read_log(each).run
        holds(run, joint_names=JOINTS, rate=100.0)
        holds(run, position=POSITION, velocity=VELOCITY, effort=EFFORT)
        assert run.meta["start"] == "1700000000"
        assert run.meta["topics"] == ["/joint_states"]


def test_the_stamps_are_those_of_the_messages_and_without_any_those_of_the_recorder(tmp_path):
    late = TIMES + np.random.default_rng(3).integers(0, 4_000_000, len(TIMES))
    run = read_log(bag(tmp_path, {"/joint_states": states(received=late)})).run
    assert np.array_equal(run.position, POSITION)
    messages = states(times=np.zeros(len(TIMES), dtype=int), received=TIMES)
    imported = read_log(bag(tmp_path, {"/joint_states": messages}, name="bare"))
    assert np.array_equal(imported.run.position, POSITION)
    assert "bare: the messages have no stamps, those of the recorder are used" in imported.remarks


def test_messages_are_in_the_order_in_which_they_were_received(tmp_path):
    mixed = sorted(states(), key=lambda each: int(each[0]) // 10_000_000 % 7)
    path = write_mcap(tmp_path / "log.mcap", [(at, TALK.raw(message)) for at, message in mixed])
    assert np.array_equal(read_log(path).run.position, POSITION)


def test_joints_may_change_their_order_and_messages_without_velocities_are_a_gap(tmp_path):
    messages = [
        (at, TALK.joint_state(at, names, POSITION[n, order], VELOCITY[n, order] if n > 2 else ()))
        for n, at in enumerate(TIMES)
        for order in ([0, 1, 2] if n % 2 else [2, 0, 1],)
        for names in ([JOINTS[place] for place in order],)
    ]
    run = read_log(bag(tmp_path, {"/joint_states": messages})).run
    order = [run.joint_names.index(joint) for joint in JOINTS]
    assert np.array_equal(np.flatnonzero(~run.mask), [0, 1, 2])
    assert np.array_equal(run.position[3:, order], POSITION[3:])
    assert np.array_equal(run.velocity[3:, order], VELOCITY[3:])


def test_an_arm_and_a_gripper_may_share_a_topic(tmp_path):
    arm = states()
    gripper = joint_states(
        TALK, TIMES + 3_000_000, ["finger"], position=POSITION[:, :1] / 50, velocity=VELOCITY[:, :1]
    )
    run = read_log(bag(tmp_path, {"/joint_states": arm + gripper})).run
    assert run.joint_names == (*JOINTS, "finger")
    assert np.array_equal(run.position[:, :3], POSITION[1 : len(run.time) + 1])


def test_a_set_of_joints_that_changes_is_refused(tmp_path):
    more = joint_states(TALK, TIMES + 4_000_000_000, ["elbow", "hand"], position=POSITION[:, :2])
    message = "/joint_states: the set of joints changes within the log; split it there"
    with pytest.raises(LogError, match=message):
        read_log(bag(tmp_path, {"/joint_states": states() + more}))


def test_of_two_robots_one_is_chosen_by_its_topic(tmp_path):
    other = joint_states(TALK, position=VELOCITY, velocity=POSITION)
    path = bag(tmp_path, {"/left/joint_states": states(), "/right/joint_states": other})
    message = (
        "/left/joint_states and /right/joint_states both hold position of joint 'shoulder'; choose"
        " with --topic"
    )
    with pytest.raises(LogError, match=message):
        read_log(path)
    run = read_log(path, topics=["/right/joint_states"]).run
    assert np.array_equal(run.position, VELOCITY)
    message = "no topic '/up' of a type that is read .*; the bag has /left/"
    with pytest.raises(LogError, match=message):
        read_log(path, topics=["/up"])


def test_joint_states_that_are_commands_are_desired_motion(tmp_path):
    commands = joint_states(TALK, position=VELOCITY, velocity=POSITION)
    run = read_log(bag(tmp_path, {"/joint_states": states(), "/joint_commands": commands})).run
    holds(run, position=POSITION, velocity_desired=POSITION, position_desired=VELOCITY)


def test_the_signal_of_a_topic_can_be_mapped(tmp_path):
    targets = joint_states(TALK, position=VELOCITY, velocity=POSITION)
    path = bag(tmp_path, {"/joint_states": states(), "/mpc": targets})
    mapping = ["position_desired=/mpc/position", "velocity_desired=/mpc/velocity"]
    holds(read_log(path, mapping=mapping).run, position_desired=VELOCITY, position=POSITION)


MEASURED, WANTED = ("feedback", "actual"), ("reference", "desired")
OLD_STATE = STATES[3]  # the only one of ROS 1


def controller_states(talk, version):
    """Messages of a version of a controller's state, by its definition."""
    talk.store = get_typestore(Stores.ROS1_NOETIC if talk.ros1 else Stores.ROS2_HUMBLE)
    talk.store.register(get_types_from_msg(version, STATE))
    many = talk.store.types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"]
    messages = []
    for n, at in enumerate(TIMES):
        others = {
            "std_msgs/Header": talk.header(int(at)),
            "string[]": [],
            "trajectory_msgs/JointTrajectoryPoint": talk.point(),
            "trajectory_msgs/MultiDOFJointTrajectoryPoint": many([], [], [], talk.duration(0.0)),
            "float64": 0.5,
        }
        known = {
            "joint_names": list(JOINTS),
            **dict.fromkeys(MEASURED, talk.point(POSITION[n], VELOCITY[n], EFFORT[n])),
            **dict.fromkeys(WANTED, talk.point(VELOCITY[n], POSITION[n])),
        }
        fields = map(str.split, version.strip().splitlines())
        parts = {name: known.get(name, others[kind]) for kind, name in fields}
        messages.append((at, talk.store.types[STATE](**parts)))
    return messages


@pytest.mark.parametrize(("ros1", "version"), [(True, OLD_STATE), *((False, v) for v in STATES)])
def test_every_version_of_a_controllers_state_has_measured_and_desired_motion(
    tmp_path, ros1, version
):
    talk = Talk(ros1=ros1)
    run = read_log(bag(tmp_path, {"/arm/state": controller_states(talk, version)}, talk=talk)).run
    holds(run, position=POSITION, velocity=VELOCITY, effort=EFFORT)
    holds(run, position_desired=VELOCITY, velocity_desired=POSITION)


@pytest.mark.parametrize(
    ("every", "start", "rate", "other"),
    [
        (1, 0, 100.0, "/arm/state/actual/positions"),
        (2, 0, 100.0, "/joint_states/position"),
        (2, 200, 50.0, "/arm/state/actual/positions"),  # the whole motion counts more
    ],
)
def test_of_joint_states_and_a_controllers_feedback_the_faster_is_read(
    tmp_path, every, start, rate, other
):
    talk = Talk()
    state = controller_states(talk, OLD_STATE)[start:]
    own = joint_states(talk, TIMES[::every], position=EFFORT[::every], velocity=EFFORT[::every])
    imported = read_log(bag(tmp_path, {"/joint_states": own, "/arm/state": state}, talk=talk))
    run, taken = imported.run, POSITION if other.startswith("/joint") else EFFORT
    assert (run.rate, len(run.time)) == (rate, 400 * rate / 100)
    assert np.array_equal(run.position, taken[:: round(100 / rate)])
    assert start or np.array_equal(run.position_desired, VELOCITY)
    assert any(f"not read: {other}" in each for each in imported.remarks)


def test_the_fastest_joints_are_read_as_they_are_and_slower_ones_are_interpolated(tmp_path):
    slow = numbers(5)[::4] / 10
    hand = joint_states(TALK, TIMES[::4], [f"f{n}" for n in range(5)], position=slow)
    imported = read_log(bag(tmp_path, {"/arm": states(), "/hand": hand}))
    assert imported.run.rate == 100.0
    assert np.array_equal(imported.run.position[:, :3], POSITION[:397])
    assert np.allclose(imported.run.position[::4, 3:], slow)
    note = "position of f0 to f4: interpolated from 25 Hz: nothing above 12.5 Hz is left"
    assert imported.run.meta["notes"] == [note]
    assert note in imported.remarks


@pytest.mark.parametrize(
    ("part", "share"), [(slice(300, None), 25), (slice(100), 25), (np.r_[:150, 250:400], 75)]
)
def test_a_side_topic_that_is_late_early_or_interrupted_cuts_no_motion_away(tmp_path, part, share):
    sides = {
        "/gripper": joint_states(TALK, TIMES[part], ["finger"], position=POSITION[part, :1]),
        "/joint_commands": joint_states(TALK, TIMES[part], velocity=VELOCITY[part]),
    }
    run = read_log(bag(tmp_path, {"/joint_states": states()} | sides)).run
    holds(run, velocity_desired=None, joint_names=JOINTS, velocity=VELOCITY)
    assert run.mask.all()
    named = ("position of finger", "velocity desired of shoulder, elbow, wrist")
    why = f"left out, there for {share}% of the time"
    assert run.meta["notes"] == [f"{each}: {why}" for each in named]


def test_odometry_is_the_base_in_body_axes(tmp_path):
    robot = Talk()
    messages = []
    for n, at in enumerate(TIMES):
        half = 0.001 * n
        turn = robot.make("geometry_msgs/Quaternion", x=0.0, y=0.0, z=np.sin(half), w=np.cos(half))
        place = robot.make("geometry_msgs/Point", x=POSITION[n, 0], y=0.0, z=0.5)
        pose = robot.make("geometry_msgs/Pose", position=place, orientation=turn)
        linear = robot.make("geometry_msgs/Vector3", x=VELOCITY[n, 0], y=0.0, z=0.0)
        angular = robot.make("geometry_msgs/Vector3", x=0.0, y=0.0, z=VELOCITY[n, 1])
        twist = robot.make("geometry_msgs/Twist", linear=linear, angular=angular)
        blank = np.zeros(36)
        message = robot.make(
            "nav_msgs/Odometry",
            header=robot.header(int(at), "odom"),
            child_frame_id="base_link",
            pose=robot.make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=blank),
            twist=robot.make("geometry_msgs/TwistWithCovariance", twist=twist, covariance=blank),
        )
        messages.append((at, message))
    run = read_log(bag(tmp_path, {"/joint_states": states(), "/odom": messages})).run
    assert np.array_equal(run.base_pose[:, 0], POSITION[:, 0])
    assert np.array_equal(run.base_velocity[:, 0], VELOCITY[:, 0])
    assert np.array_equal(run.base_velocity[:, 5], VELOCITY[:, 1])


def test_topics_that_are_not_read_are_listed(tmp_path):
    flag = [(at, TALK.make("std_msgs/Bool", data=True)) for at in TIMES[:3]]
    topics = {"/joint_states": states(), "/stop": flag, "/odom": "nav_msgs/msg/Odometry"}
    imported = read_log(bag(tmp_path, topics))
    expected = "bag: 2 columns not read: /stop (std_msgs/msg/Bool), /odom (no messages)"
    assert expected in imported.remarks


STOP = {"/stop": [(EPOCH, TALK.make("std_msgs/Bool", data=True))]}


@pytest.mark.parametrize(
    ("states", "message"),
    [
        ("sensor_msgs/msg/JointState", "no topic holds joints; the bag has /join"),
        (None, r"no topic holds joints; the bag has /stop \(std_msgs/msg/Bool\)"),
        (joint_states(TALK, TIMES[:1], position=POSITION), "bag: 1 sample; a run needs at least 2"),
        (joint_states(TALK, names=[]), "no message holds joints"),
        (joint_states(TALK, effort=EFFORT), "no message holds joints"),
    ],
)
def test_a_bag_without_motion_is_an_error_of_one_line(tmp_path, states, message):
    path = bag(tmp_path, {"/joint_states": states} if states else STOP)
    with one_line(LogError, message, path):
        read_log(path)


def test_columns_of_nan_are_left_out_and_an_infinite_value_is_named(tmp_path):
    never, broken = np.full_like(EFFORT, np.nan), VELOCITY.copy()
    broken[123, 1] = np.inf
    for name, velocity in (("bag", VELOCITY), ("infinite", broken)):
        messages = joint_states(TALK, position=POSITION, velocity=velocity, effort=never)
        bag(tmp_path, {"/joint_states": messages}, name=name)
    imported = read_log(tmp_path / "bag")
    assert imported.run.effort is None
    assert any("all nan, left out: /joint_states/effort of" in r for r in imported.remarks)
    message = (
        r"column '/joint_states/velocity of elbow' holds inf \(sample 124, 1.23 s into the log\)"
    )
    with pytest.raises(LogError, match=message):
        read_log(tmp_path / "infinite")


def test_a_long_bag_takes_little_more_memory_than_its_values(tmp_path):
    times = EPOCH + 1_000_000 * np.arange(8000)
    times += np.random.default_rng(0).integers(-100_000, 100_000, len(times))
    names = [f"joint_{n}" for n in range(60)]
    arrays = {
        name: np.tile(numbers(10, 8000, seed) / 10, 6)
        for seed, name in enumerate(("position", "velocity", "effort"))
    }
    path = bag(tmp_path, {"/joint_states": joint_states(TALK, times, names, **arrays)})
    size = 3 * read_log(path).run.velocity.nbytes  # what is imported on the way does not count
    assert size == pytest.approx(8000 * 180 * 8, rel=0.01)
    with memory_below(1.8 * size + 40e6):
        read_log(path)


def test_some_of_a_robots_joints_are_enough_including_mimic_joints(tmp_path):
    names = ["panda_finger_joint2", "panda_joint7", "panda_finger_joint1", "panda_joint2", "gantry"]
    position = np.abs(numbers(5)) / 100
    path = bag(tmp_path, {"/joint_states": joint_states(TALK, TIMES, names, position=position)})
    imported = read_log(path, robot="panda")
    assert "bag: left out, not joints of 'panda': gantry" in imported.remarks
    run = imported.run
    assert run.joint_names == tuple(names[:4])
    q, _ = Robot.load("panda", mimic=True).configuration(run)
    assert np.array_equal(q[:, [6, 7, 1]], position[:, [1, 2, 3]])

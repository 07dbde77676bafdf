"""Logs of other people's formats, written by the libraries that they are written with."""

import json

import numpy as np

RATE = 100.0
EPOCH = 1_700_000_000_000_000_000  # when the samples begin, in [ns]
TIMES = EPOCH + 10_000_000 * np.arange(400)  # stamps at 100 Hz, in [ns]
JOINTS = ("shoulder", "elbow", "wrist")


def numbers(joints=3, samples=400, seed=0):
    """Numbers that use all bits of a float64, small enough for radians."""
    return np.random.default_rng(seed).standard_normal((samples, joints))


def motion(time, joints=3, seed=0):
    """Positions and velocities of joints that move smoothly and never in the same way again."""
    random = np.random.default_rng(seed)
    frequency = random.uniform(0.05, 1.5, (12, joints))
    phase, size = random.uniform(0, 6, (12, joints)), random.normal(size=(12, joints)) / 12
    angle = 2 * np.pi * frequency * np.asarray(time)[:, None, None] + phase
    slope = size * 2 * np.pi * frequency
    return (size * np.sin(angle)).sum(axis=1), (slope * np.cos(angle)).sum(axis=1)


class Talk:
    """Makes messages by name, and serialises them as one generation of ROS does it."""

    def __init__(self, *, ros1=False):
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.ros1 = ros1

    def make(self, kind, /, **parts):
        package, _, name = kind.partition("/")
        return self.store.types[f"{package}/msg/{name}"](**parts)

    def header(self, stamp, frame=""):
        time = self.make("builtin_interfaces/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        more = {"seq": 0} if self.ros1 else {}
        return self.make("std_msgs/Header", stamp=time, frame_id=frame, **more)

    def duration(self, seconds):
        sec, rest = divmod(round(seconds * 1e9), 10**9)
        return self.make("builtin_interfaces/Duration", sec=int(sec), nanosec=int(rest))

    def joint_state(self, stamp, names, position=(), velocity=(), effort=()):
        arrays = {"position": position, "velocity": velocity, "effort": effort}
        return self.make(
            "sensor_msgs/JointState",
            header=self.header(int(stamp)),
            name=list(names),
            **{name: np.asarray(each, dtype=np.float64) for name, each in arrays.items()},
        )

    def point(self, positions=(), velocities=(), effort=()):
        return self.make(
            "trajectory_msgs/JointTrajectoryPoint",
            positions=np.asarray(positions, dtype=np.float64),
            velocities=np.asarray(velocities, dtype=np.float64),
            accelerations=np.zeros(0),
            effort=np.asarray(effort, dtype=np.float64),
            time_from_start=self.duration(0.0),
        )

    def raw(self, message):
        serialise = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        return serialise(message, message.__msgtype__)


def write_bag(path, talk, topics, *, storage="mcap", compression=None):
    """Write a bag: a folder, or a file of ROS 1.

    A topic has messages with the times that the recorder had them, or the name of their type alone.
    Compression is "storage", "message", "file", or for ROS 1 "lz4" or "bz2".
    """
    if talk.ros1:
        from rosbags.rosbag1 import Writer

        writer = Writer(path)
        if compression:
            writer.set_compression(Writer.CompressionFormat[compression.upper()])
    else:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        plugin = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}[storage]
        writer = Writer(path, version=9, storage_plugin=plugin)
        if compression:
            writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        entries = []
        for topic, messages in topics.items():
            kind = messages if isinstance(messages, str) else messages[0][1].__msgtype__
            connection = writer.add_connection(topic, kind, typestore=talk.store)
            if not isinstance(messages, str):
                entries += [(int(at), connection, message) for at, message in messages]
        for at, connection, message in sorted(entries, key=lambda each: each[0]):
            writer.write(connection, at, talk.raw(message))
    return path


def write_mcap(path, messages, *, kind="sensor_msgs/msg/JointState", text="", **how):
    """Write an MCAP file of messages with their times, whatever the definition of their type."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream, **how)
        writer.start("ros2")
        schema = writer.register_schema(kind, "ros2msg", text.encode())
        topic = writer.register_channel("/joint_states", "cdr", schema)
        for at, data in messages:
            writer.add_message(topic, int(at), bytes(data), int(at))
        writer.finish()
    return path


def joint_states(talk, times=TIMES, names=JOINTS, received=None, **arrays):
    """Messages of joint states, each a row of the arrays."""
    received = times if received is None else received
    return [
        (at, talk.joint_state(stamp, names, **{name: rows[n] for name, rows in arrays.items()}))
        for n, (at, stamp) in enumerate(zip(received, times, strict=True))
    ]


def write_lerobot(folder, episodes, *, names, v3=True, fps=30):
    """Write a LeRobot data set of states, (frames, joints) each, the actions a frame ahead."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    width = episodes[0].shape[1]
    feature = {"dtype": "float32", "shape": [width], "names": names}
    info = {
        "codebase_version": "v3.0" if v3 else "v2.1",
        "robot_type": "so101",
        "fps": fps,
        "features": {"observation.state": feature, "action": feature, "timestamp": {}},
    }
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    tables = []
    for number, state in enumerate(episodes):
        state = np.asarray(state, dtype=np.float32)
        columns = {
            "observation.state": list(state),
            "action": list(np.roll(state, -1, axis=0)),
            "timestamp": (np.arange(len(state)) / fps).astype(np.float32),
            "frame_index": np.arange(len(state)),
            "episode_index": np.full(len(state), number),
        }
        tables.append(pa.table(columns))
        if not v3:
            pq.write_table(tables[-1], data / f"episode_{number:06d}.parquet")
    if v3:
        pq.write_table(pa.concat_tables(tables), data / "file-000.parquet")
    return folder


def cut(path, share):
    """Cut a file off, as a full disk or a lost battery does."""
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    return path

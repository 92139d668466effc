"""Kinds of files that ROS's messages are stored in, told by their first bytes."""

ROS1 = b"#ROSBAG"
SQLITE = b"SQLite format 3\0"
MCAP = b"\x89MCAP0\r\n"

"""A node on DDS that speaks ROS 2's wire types, without ROS: needs the extra ``dds`` (cyclonedds)."""

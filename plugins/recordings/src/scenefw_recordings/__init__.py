"""Images of ROS and RealSense recordings, and of a RealSense camera."""

"""Files that a user names: reading them and pictures in them, warnings about them, and finding
shipped models, ROS packages and files that others refer to.
"""

"""Files that a user names: reading them, and finding shipped models, ROS packages and files that
others refer to.
"""

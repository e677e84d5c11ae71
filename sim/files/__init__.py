"""Files that a user names: reading of files and of pictures, warnings about files, and the search
for shipped models, ROS packages and files that other files refer to.
"""

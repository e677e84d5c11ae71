"""Our trackers with the interfaces of OpenCV and of the GOT-10k and VOT toolkits, and servers of
TraX and of our own protocol for programs.
"""

from tracking.exported.toolkits import Got10kTracker, OpenCVTracker, VotHandle, run_vot

__all__ = ["Got10kTracker", "OpenCVTracker", "VotHandle", "run_vot"]

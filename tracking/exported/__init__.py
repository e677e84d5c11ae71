"""Our trackers with the interfaces of OpenCV, of the GOT-10k and VOT toolkits, and of TraX."""

from tracking.exported.toolkits import Got10kTracker, OpenCVTracker, VotHandle, run_vot

__all__ = ["Got10kTracker", "OpenCVTracker", "VotHandle", "run_vot"]

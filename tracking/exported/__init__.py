"""Our trackers with the interfaces of OpenCV, GOT-10k, the VOT toolkit and TraX."""

from tracking.exported.toolkits import Got10kTracker, OpenCVTracker, VotHandle, run_vot

__all__ = ["Got10kTracker", "OpenCVTracker", "VotHandle", "run_vot"]

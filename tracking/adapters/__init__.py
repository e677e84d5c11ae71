"""Our trackers with the interfaces of OpenCV, GOT-10k, the VOT toolkit and TraX."""

from tracking.adapters.as_got10k import Got10kTracker
from tracking.adapters.as_opencv import OpenCVTracker
from tracking.adapters.as_vot import VotHandle, run_vot

__all__ = ["Got10kTracker", "OpenCVTracker", "VotHandle", "run_vot"]

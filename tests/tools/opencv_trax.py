"""A tracker of OpenCV as a TraX server: python tests/tools/opencv_trax.py CSRT.

It made the rows of CSRT, KCF and MIL in the tables of loop-v1 and loop-v2, in an environment of its own: it needs the packages vot-trax and
opencv-contrib-python-headless. Where OpenCV says that it does not see the target, it answers with a box of
zeros, as vot-trax cannot answer with no region.
"""

import sys

import cv2
import trax

SEED = 1
NOWHERE = trax.Rectangle.create(0, 0, 0, 0)


def main(name: str) -> None:
    """Answer a client until it quits."""
    tracker = None
    with trax.Server([trax.Region.RECTANGLE], [trax.Image.MEMORY], tracker_name=name) as server:
        while True:
            request = server.wait()
            if request.type == trax.TraxStatus.QUIT:
                return
            picture = cv2.cvtColor(request.image["color"].array(), cv2.COLOR_RGB2BGR)
            if request.type == trax.TraxStatus.INITIALIZE:
                tracker = getattr(cv2, f"Tracker{name}").create()
                region = request.objects[0][0]
                cv2.setRNGSeed(SEED)  # MIL draws its samples; the others draw nothing
                tracker.init(picture, tuple(round(side) for side in region.bounds()))
                server.status([(region, {})])
                continue
            seen, box = tracker.update(picture)
            server.status([(trax.Rectangle.create(*box) if seen else NOWHERE, {})])


if __name__ == "__main__":
    main(sys.argv[1])

"""dlib's correlation tracker as a TraX server: python tests/tools/dlib_trax.py.

It made dlib's rows in the tables of loop-v1 and loop-v2, in an environment of its own: it needs the packages vot-trax and dlib-bin. The
tracker is that of Danelljan, Hager, Khan and Felsberg, "Accurate scale estimation for robust visual tracking" (2014).
"""

import dlib
import trax


def main() -> None:
    """Answer a client until it quits."""
    tracker = dlib.correlation_tracker()
    with trax.Server([trax.Region.RECTANGLE], [trax.Image.MEMORY], tracker_name="dlib") as server:
        while True:
            request = server.wait()
            if request.type == trax.TraxStatus.QUIT:
                return
            picture = request.image["color"].array()
            if request.type == trax.TraxStatus.INITIALIZE:
                region = request.objects[0][0]
                x, y, width, height = region.bounds()
                tracker.start_track(picture, dlib.drectangle(x, y, x + width, y + height))
                server.status([(region, {})])
                continue
            tracker.update(picture)
            box = tracker.get_position()
            found = trax.Rectangle.create(box.left(), box.top(), box.width(), box.height())
            server.status([(found, {})])


if __name__ == "__main__":
    main()

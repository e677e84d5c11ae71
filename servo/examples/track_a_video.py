"""Example of a tracker on a video file, here a film of the simulated camera; its estimates are
compared with the true positions of the target.
"""

import av
import numpy as np

import servo

scenario = servo.load("occlusion_partial", controller="hold", tracker="truth", duration=2.0)
steps = list(servo.run(scenario))
with av.open("target.mp4", "w") as film:
    stream = film.add_stream(
        "libx264", rate=30, options={"crf": "12"}, width=320, height=240, pix_fmt="yuv420p"
    )
    for step in steps:
        film.mux(stream.encode(av.VideoFrame.from_ndarray(step.frame.image, format="rgb24")))
    film.mux(stream.encode())

tracker = servo.create("annealed")
misses = []
with av.open("target.mp4") as film:
    for index, picture in enumerate(film.decode(video=0)):
        frame = servo.Frame(picture.to_ndarray(format="rgb24"), index / 30, index)
        if index == 0:
            tracker.start(frame, steps[0].region, steps[0].true_state)
            continue
        estimate = tracker.update(frame)
        state = np.array([estimate.state.x, estimate.state.y])
        misses.append(np.linalg.norm(state - steps[index].truth.centre))
print(f"{len(misses)} pictures, {np.median(misses):.2f} px from the truth (median)")

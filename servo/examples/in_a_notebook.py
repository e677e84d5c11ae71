"""Example of a notebook cell: run a scenario, show its measures and plots, and save a picture and a
film.
"""

import servo

result = servo.simulate("reversal", seed=3, gain=1.5, duration=1.0, after=0.5)
result  # alone in a cell: outcome, measures and plots
print(result.measures)
result.figure().savefig("errors.png")
result.frame(0.4).save("picture.png")  # truth white, goal red, estimate green
result.film().save("film.mp4")

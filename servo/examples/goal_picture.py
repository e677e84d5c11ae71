"""Example of servoing to a goal picture by the brightness of all pixels (features "photometric").
It writes the picture at the goal, the first and the last picture as PNG files.
"""

import cv2

import servo

with servo.Episode(servo.load("photometric", vary={}), shows_goal=True) as episode:
    cv2.imwrite("goal.png", episode.goal_picture[..., ::-1])
    steps = list(episode)
for name, step in (("first", steps[0]), ("last", steps[-1])):
    cv2.imwrite(f"{name}.png", step.frame.image[..., ::-1])
    off = cv2.absdiff(step.frame.image, episode.goal_picture).mean()
    print(f"{name} picture: {off:.1f} grey levels from the goal's, {step.servo_error:.2f} px")

"""Package of recordings of real scenes, which take the place of a rendered scene: pictures of a
camera that turns about the centre of the recording camera, and the motion of the target that they
show.

The pictures of a camera that only turns about the centre of the recording camera follow exactly
from the recorded ones: its pixel u shows what the pixel K_r R K_v^-1 u of the recording shows, with
R the rotation of the turning camera in the frame of the recording one and K_v and K_r their
intrinsics, after the distortions of both lenses are removed (R. Hartley and A. Zisserman, "Multiple
View Geometry in Computer Vision", 2nd edition, 2004, section 8.4).
"""

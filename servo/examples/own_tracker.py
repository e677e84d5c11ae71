"""Example of a custom tracker in the closed loop: template matching by OpenCV."""

import cv2

import servo


class TemplateMatching:
    """Tracker that finds the upright rectangle of a picture that correlates best with the target in
    the first picture; the size of the rectangle never changes.
    """

    def init(self, image, rect):
        """Cut the template, the target's appearance, out of the first picture.

        Args:
            image: The first picture, BGR (H, W, 3).
            rect: The target's rectangle: left, top, width, height [px].
        """
        left, top, width, height = map(int, rect)
        self.size = width, height
        self.template = image[top : top + height, left : left + width]

    def update(self, image):
        """Return whether the target is seen in the next picture (BGR, (H, W, 3)), which is when the
        best correlation is above 0.5, and its rectangle: left, top, width, height [px].
        """
        scores = cv2.matchTemplate(image, self.template, cv2.TM_CCOEFF_NORMED)
        _, best, _, place = cv2.minMaxLoc(scores)
        return best > 0.5, (*place, *self.size)


scenario = servo.load("line", tracker=TemplateMatching, duration=2.0)
errors = [step.servo_error for step in servo.run(scenario)]
print(f"largest distance from the goal: {max(errors):.1f} px")

"""The mean of the views of one plate over the frames of its track.

From frame to frame a plate moves by fractions of a pixel, so the mean of its rectified views shows
more than any of them, and has less noise (super-resolution by shift and add; Elad and Hel-Or 2001,
A fast super-resolution reconstruction algorithm for pure translational motion). The corners that
the detector finds are the alignment; fitting each view to the mean is worse.

The lens, the pixels and the averaging blur it. As there is less noise than in one view, it is
sharpened before it is read.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

Views = npt.NDArray[np.float32]
"""(views, 1, 64, 160), normalised."""

MAX_FRAMES = 12
"""Frames that a mean is worth; older ones fade."""
MIN_LIKENESS = 0.7
"""Correlation of the first view with the mean, from which both show one plate. On rendered drives
it is lower for 2 % of the views of one plate, which begin a mean of their own, and for 40 % of
those of another plate of the same format."""
BLUR_PX, SHARPENING = 0.7, 3.0
"""Sigma of the blur, in pixels of the image, and the share of what it took that is added to the
mean of many frames."""


@dataclass(frozen=True, slots=True, eq=False)
class PlateViews:
    """The mean over the frames so far."""

    mean: Views
    frames: float = 1.0

    def sharpened(self, px_per_pixel: float) -> Views:
        """The mean, sharpened by as much as frames have taken its noise (unsharp masking).

        Args:
            px_per_pixel: columns of the view to a pixel of the image.
        """
        amount = SHARPENING * (1.0 - 1.0 / self.frames)
        if amount == 0.0:
            return self.mean
        sigma = BLUR_PX * px_per_pixel
        sharp = np.stack(
            [
                (1 + amount) * view - amount * cv2.GaussianBlur(view, (0, 0), sigma)
                for view in self.mean[:, 0]
            ]
        )[:, None]
        return np.asarray(sharp * (self.mean.std() / max(float(sharp.std()), 1e-6)), np.float32)

    def with_views(self, views: Views) -> "PlateViews":
        """Add the views of another frame; only these, if they show something else."""
        if _likeness(self.mean[0], views[0]) < MIN_LIKENESS:
            return PlateViews(views)
        frames = min(self.frames + 1.0, MAX_FRAMES)
        mean = self.mean + (views - self.mean) / np.float32(frames)
        return PlateViews(np.asarray(mean, np.float32), frames)


def _likeness(one: npt.NDArray[np.float32], other: npt.NDArray[np.float32]) -> float:
    """Correlation of two views."""
    one, other = one - one.mean(), other - other.mean()
    return float((one * other).sum() / max(np.sqrt((one**2).sum() * (other**2).sum()), 1e-6))

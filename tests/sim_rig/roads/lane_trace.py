"""A trace of cars that follow each other."""

from pathlib import Path

import numpy as np


def write_lane(path: Path, cars: int) -> Path:
    """Write 30 s of cars in one lane at 15 m/s, 12 m from bumper to bumper, the first one ahead."""
    rows = [
        f"{at_s:.1f},car{number},{15.0 * at_s - 16.0 * number},0,0,15,4,2"
        for at_s in np.arange(0.0, 30.0, 0.1)
        for number in range(cars)
    ]
    path.write_text("\n".join(["t,id,x,y,heading,v,length,width", *rows]))
    return path

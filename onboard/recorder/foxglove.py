"""Images and fixes in Foxglove's schemas, which it shows as pictures and on a map.

https://docs.foxglove.dev/docs/sdk/schemas: CompressedImage and LocationFix, as JSON.
"""

import base64
from typing import Any, Final

from onboard.observations import Position

IMAGE: Final = "foxglove.CompressedImage"
LOCATION: Final = "foxglove.LocationFix"

_COVARIANCE_OF_DIAGONAL = 2
"""LocationFix.PositionCovarianceType.DIAGONAL_KNOWN."""

_COMMON = {
    "timestamp": {
        "type": "object",
        "title": "time",
        "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
    },
    "frame_id": {"type": "string"},
}

SCHEMAS: Final[dict[str, dict[str, Any]]] = {
    IMAGE: {
        "title": IMAGE,
        "type": "object",
        "properties": _COMMON
        | {
            "data": {"type": "string", "contentEncoding": "base64"},
            "format": {"type": "string"},
        },
    },
    LOCATION: {
        "title": LOCATION,
        "type": "object",
        "properties": _COMMON
        | {
            "latitude": {"type": "number"},
            "longitude": {"type": "number"},
            "altitude": {"type": "number"},
            "position_covariance": {"type": "array", "items": {"type": "number"}},
            "position_covariance_type": {"type": "integer"},
        },
    },
}


def compressed_image(jpeg: bytes, utc_s: float) -> dict[str, Any]:
    """A camera image."""
    return _stamped("camera", utc_s) | {
        "data": base64.b64encode(jpeg).decode(),
        "format": "jpeg",
    }


def location_fix(position: Position, utc_s: float) -> dict[str, Any]:
    """A position; its height has no accuracy and counts as exact."""
    variance_m2 = position.sigma_m**2
    return _stamped("gnss", utc_s) | {
        "latitude": position.latitude_deg,
        "longitude": position.longitude_deg,
        "altitude": position.altitude_m or 0.0,
        "position_covariance": [variance_m2, 0.0, 0.0, 0.0, variance_m2, 0.0, 0.0, 0.0, 0.0],
        "position_covariance_type": _COVARIANCE_OF_DIAGONAL,
    }


def _stamped(frame_id: str, utc_s: float) -> dict[str, Any]:
    seconds, fraction = divmod(utc_s, 1.0)
    return {
        "timestamp": {"sec": int(seconds), "nsec": int(fraction * 1e9)},
        "frame_id": frame_id,
    }

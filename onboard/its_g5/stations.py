"""What CAMs of a station have said before, for messages that do not say it.

The path and the lights are in two CAMs a second only, and size and axes in no DENM. A station is
known by its ID and its signer: whoever takes another's ID changes nothing for that one.
"""

import math
from collections import OrderedDict
from dataclasses import replace

from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import MAX_OFFSET_DEG, PathHistory, VehicleSafetyExtensions

HELD_S = 1.5
"""Time for which path, lights and size are kept: a station at rest sends them once a second."""
MAX_STATIONS = 1024
"""More than are in radio range on any road; those received last are kept."""


class Stations:
    """The last low frequency container of each station, as the BSM that it gave."""

    def __init__(self) -> None:
        """Start with no station."""
        self._last: OrderedDict[tuple[bytes, bytes | None], tuple[float, BasicSafetyMessage]] = (
            OrderedDict()
        )

    def receive_whole(
        self, message: BasicSafetyMessage, signer_id: bytes | None, utc_s: float
    ) -> None:
        """Keep a message that says everything."""
        key = message.core.temporary_id, signer_id
        self._last[key] = utc_s, message
        self._last.move_to_end(key)
        if len(self._last) > MAX_STATIONS:
            self._last.popitem(last=False)

    def completed(
        self, message: BasicSafetyMessage, signer_id: bytes | None, utc_s: float
    ) -> BasicSafetyMessage:
        """Return a message with what its station has said lately, where it says nothing itself."""
        kept_utc_s, kept = self._last.get(
            (message.core.temporary_id, signer_id), (-math.inf, message)
        )
        if not 0.0 <= utc_s - kept_utc_s <= HELD_S or kept.safety is None:
            return message
        safety, core = message.safety or VehicleSafetyExtensions(), message.core
        size = replace(
            core.size,
            width_m=core.size.width_m or kept.core.size.width_m,
            length_m=core.size.length_m or kept.core.size.length_m,
        )
        history = safety.path_history or _seen_from(core, kept)
        return replace(
            message,
            core=replace(core, size=size),
            safety=replace(
                safety, path_history=history, lights=safety.lights or kept.safety.lights
            ),
        )


def _seen_from(here: CoreData, kept: BasicSafetyMessage) -> PathHistory | None:
    """Return the path history of an earlier message as offsets from a later position."""
    there, history = kept.core, kept.safety.path_history if kept.safety is not None else None
    if (
        history is None
        or here.latitude_deg is None
        or here.longitude_deg is None
        or there.latitude_deg is None
        or there.longitude_deg is None
    ):
        return None
    north_deg = there.latitude_deg - here.latitude_deg
    east_deg = math.remainder(there.longitude_deg - here.longitude_deg, 360.0)
    points = tuple(
        replace(
            point,
            latitude_offset_deg=point.latitude_offset_deg + north_deg,
            longitude_offset_deg=point.longitude_offset_deg + east_deg,
        )
        for point in history.crumb_data
        if point.latitude_offset_deg is not None
        and point.longitude_offset_deg is not None
        and abs(point.latitude_offset_deg + north_deg) <= MAX_OFFSET_DEG
        and abs(point.longitude_offset_deg + east_deg) <= MAX_OFFSET_DEG
    )
    return PathHistory(None, None, points) if points else None

"""The times and limits of the group protocol. Only those of `LccaSettings` are a user's choice."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupParameters:
    """Distances are headways: gap divided by the own speed."""

    join_headway_s: float = 1.98
    """Below it a vehicle joins its lead: 0.55 m for each km/h (LCCA, section 3)."""
    leave_headway_s: float = 2.2
    """From it on the vehicle leaves. The margin to `join_headway_s` absorbs noise of the gap."""
    leave_at_least_m: float = 10.0
    """Nearer than this it does not leave: vehicles of a jam stand, and creep, in their group."""
    lead_hold_s: float = 1.0
    """How long a membership outlasts the last frame that showed the predecessor close."""
    speed_tolerance_m_s: float = 5.0
    """Largest difference between the speed in a reply and the one that the camera measures."""

    retry_s: float = 0.1
    """Until a join is repeated; doubles while the vehicle has never answered."""
    retry_max_s: float = 0.25
    """Bounds the doubling, and with it the channel load of a lead without radio."""
    refresh_s: float = 0.5
    """Until an answered join is refreshed, unless the predecessor's BSMs arrive."""
    bsm_refresh_s: float = 2.1
    """The same while they arrive: it brings the leader's sequence number in time."""
    spread_s: float = 0.02
    """Random delay of joins that many vehicles send for the same reason."""
    membership_lifetime_s: float = 2.5
    """How long a membership lasts on either side without a message or a BSM from the other."""
    join_lifetime_s: float = 3.7
    """How long it lasts without a join, or a reply, however many BSMs arrive."""
    leader_silence_s: float = 3.0
    """How long a membership lasts without a new leader sequence number, however well the
    predecessor answers."""
    id_change_s: float = 3.0
    """How long IDs of the previous epoch stay valid after the own change: clocks may differ by
    2 s."""

    slot_s: float = 0.01
    """Forwarding: each candidate waits one slot longer than the next better placed one."""
    acknowledge_s: float = 0.06
    """Until a warning is repeated to a follower that has not acknowledged it."""
    warn_repeats: int = 10
    """Largest number of such repetitions."""
    warn_refresh_s: float = 1.0
    """Until a braking that lasts is sent again."""
    event_lifetime_s: float = 3.0
    """Age above which a warning is refused, and time for which a braking lasts without another
    one."""
    test_warning_s: float = 1.0
    """How long the braking lasts that the driver's button pretends."""


DEFAULTS = GroupParameters()

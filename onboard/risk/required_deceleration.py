"""Time to collision with a vehicle ahead, and the braking that avoids it."""

import math


def time_to_collision_s(gap_m: float, closing_speed_m_s: float, braking_m_s2: float = 0.0) -> float:
    """Return the TTC with a lead vehicle at constant speed; infinite if there is no contact.

    Args:
        gap_m: to the lead vehicle.
        closing_speed_m_s: at which the gap shrinks.
        braking_m_s2: with which the host vehicle brakes, and goes on to brake.
    """
    if closing_speed_m_s <= 0.0:
        return math.inf
    gap_m = max(gap_m, 0.0)
    at_contact = closing_speed_m_s**2 - 2.0 * braking_m_s2 * gap_m
    if at_contact < 0.0:
        return math.inf
    return 2.0 * gap_m / (closing_speed_m_s + math.sqrt(at_contact))


def required_deceleration_m_s2(
    gap_m: float,
    speed_m_s: float,
    lead_speed_m_s: float,
    lead_deceleration_m_s2: float,
    reaction_s: float,
    *,
    braking_m_s2: float = 0.0,
) -> float:
    """Return the constant deceleration, from `reaction_s` on, that just avoids the lead vehicle.

    Until then the host vehicle keeps `braking_m_s2`. The lead vehicle keeps its deceleration until
    it stands.

    Args:
        gap_m: to the lead vehicle.
        speed_m_s: of the host vehicle.
        lead_speed_m_s: of the lead vehicle.
        lead_deceleration_m_s2: of the lead vehicle, 0 or more.
        reaction_s: time until the host vehicle brakes so.
        braking_m_s2: deceleration of the host vehicle before that, 0 or more.

    Returns:
        the deceleration; 0 if none is needed, infinite if none is enough.
    """
    lead_speed_m_s = max(lead_speed_m_s, 0.0)
    if lead_deceleration_m_s2 > 0.0:
        lead_stops_s = lead_speed_m_s / lead_deceleration_m_s2
        lead_stops_m = lead_speed_m_s * lead_stops_s / 2.0
    else:
        lead_stops_s = lead_stops_m = math.inf if lead_speed_m_s > 0.0 else 0.0
    moving_s = min(reaction_s, lead_stops_s)
    lead_m = lead_speed_m_s * moving_s - lead_deceleration_m_s2 * moving_s**2 / 2.0
    speed_then_m_s = max(speed_m_s - braking_m_s2 * reaction_s, 0.0)
    driven_s = (speed_m_s - speed_then_m_s) / braking_m_s2 if braking_m_s2 > 0.0 else reaction_s
    driven_m = (speed_m_s + speed_then_m_s) / 2.0 * driven_s
    gap_then_m = gap_m + lead_m - driven_m
    if gap_then_m <= 0.0:
        return math.inf
    lead_then_m_s = max(lead_speed_m_s - lead_deceleration_m_s2 * reaction_s, 0.0)
    closing_m_s = speed_then_m_s - lead_then_m_s
    if braking_m_s2 > 0.0 and closing_m_s < 0.0:  # the gap was least before
        lead = lead_speed_m_s, lead_deceleration_m_s2
        return 0.0 if brakes_enough(gap_m, speed_m_s, *lead, braking_m_s2) else math.inf
    braking = lead_deceleration_m_s2 if lead_then_m_s > 0.0 else 0.0
    if closing_m_s > 0.0:
        while_both_move = braking + closing_m_s**2 / (2.0 * gap_then_m)
        if while_both_move * (lead_stops_s - reaction_s) >= speed_then_m_s:
            return while_both_move
    return speed_then_m_s**2 / (2.0 * (gap_m + lead_stops_m - driven_m))


def brakes_enough(
    gap_m: float,
    speed_m_s: float,
    lead_speed_m_s: float,
    lead_deceleration_m_s2: float,
    braking_m_s2: float | None,
) -> bool:
    """Whether the host vehicle's present deceleration, held, avoids the lead vehicle.

    Args:
        gap_m: to the lead vehicle.
        speed_m_s: of the host vehicle.
        lead_speed_m_s: of the lead vehicle.
        lead_deceleration_m_s2: of the lead vehicle.
        braking_m_s2: of the host vehicle; `None` and NaN are unknown, and not enough.
    """
    return braking_m_s2 is not None and braking_m_s2 >= required_deceleration_m_s2(
        gap_m, speed_m_s, lead_speed_m_s, lead_deceleration_m_s2, reaction_s=0.0
    )

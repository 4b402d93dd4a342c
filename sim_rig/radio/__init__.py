"""The radio: a unit at the end of each car's UDP wire, and the air between the units.

`open_air(scenario.radio, cars_at, units, rng)` (`models.py`) gives the rig's air for cars by name
and frames as bytes. A study with hundreds of cars talks to the 802.11p channel itself, by index:

    channel = Channel(CsmaSettings(), stations=400, rng=rng)
    channel.receive_positions(position_m)              # (400, 2), NaN: not there; each 0.1 s or so
    number = channel.receive_frame(station, payload_bytes, user_priority, now)
    channel.handle_timer(now)                          # at get_timer(), or once each step
    while (reception := channel.next_event()) is not None:
        reception.number, reception.sender, reception.receivers, reception.at_s

Every frame gives one `Reception` when it ends, also the one that nobody has; who is not among its
receivers has lost it. What a frame holds stays with the caller, under its number. Handled late,
everything still happens at its own time: `at_s` and `sent_s` are exact however long a step is.
"""

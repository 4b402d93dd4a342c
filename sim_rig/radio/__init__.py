"""The radio: a unit at the end of each car's UDP connection, and the channel between the units.

`open_air(scenario.radio, cars_at, units, rng)` (`models.py`) returns a channel for cars by name and
frames as bytes. A study with hundreds of cars uses the 802.11p channel directly, by index:

    channel = Channel(CsmaSettings(), stations=400, rng=rng)
    channel.receive_positions(position_m)              # (400, 2), NaN if absent; about every 0.1 s
    number = channel.receive_frame(station, payload_bytes, user_priority, now)
    channel.handle_timer(now)                          # at get_timer(), or once each step
    while (reception := channel.next_event()) is not None:
        reception.number, reception.sender, reception.receivers, reception.at_s

Every frame ends with one `Reception`, also without receivers; all other stations have lost it. The
caller keeps the content of a frame under its number. `at_s` and `sent_s` are exact for any interval
between calls of `handle_timer`.
"""

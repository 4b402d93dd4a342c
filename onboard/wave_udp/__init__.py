"""WAVE short messages (IEEE 1609.3) and the radio units that carry them.

`wsmp` and `psid` are the frame, `radio_queue` decides what goes out first, `endpoint` opens the
wire to the unit: plain UDP (`iwcu`), the RSU 4.1 text datagram (`rsu41`) or the link layer (`raw`).
`decode` shows what is in a capture. Nothing here but `decode` knows what a payload means.
"""

"""WAVE short messages (IEEE 1609.3) and the radio units that carry them.

`wsmp` is the frame. `radio_queue` orders outgoing frames by user priority, `receive_queue` incoming
ones under overload. `endpoint` opens the connection to the radio unit: plain UDP (`iwcu`), the RSU
4.1 text datagram (`rsu41`) or the link layer (`raw`). `capture` reads and writes pcap files. The
content of a WSM is opaque here.
"""

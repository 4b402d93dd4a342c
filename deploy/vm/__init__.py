"""The car's box as a whole: a real kernel, a real systemd, and the rig at the ends of its wires.

`python -m deploy.vm` (`make vm-test`) builds a small Debian, installs on it what `make box` made,
and does to it what happens to boxes in cars. `machine.py` is the box, `rig.py` runs in it as the
other end of the wires, `drive.py` is what is done and what must come of it.
"""

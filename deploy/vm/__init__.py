"""Test of the installed box: a real kernel and systemd, with the rig at the ends of its wires.

`python -m deploy.vm` (`make vm-test`) builds a small Debian, installs the output of `make box` on
it, and injects the faults of a computer in a car. `machine.py` is the virtual machine, `rig.py`
runs in it as the other end of the wires, and `drive.py` contains the faults and the expected
results.
"""

"""`python -m sim_rig` is `sim-rig`."""

from sim_rig.cli import main

main()

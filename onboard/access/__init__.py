"""Who should talk how often: driver-based channel access.

Source: Rakhshan, Pishro-Nik, Nekoui, "Driver-Based Adaptation of Vehicular Ad hoc Networks for
Design of Active Safety Systems".
"""

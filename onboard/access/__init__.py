"""Driver-based channel access: how often to send BSMs, from the driver's crash probability.

Source: Rakhshan, Pishro-Nik, Nekoui, "Driver-Based Adaptation of Vehicular Ad hoc Networks for
Design of Active Safety Systems".
"""

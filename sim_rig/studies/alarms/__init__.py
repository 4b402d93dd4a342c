"""The car's alarms in simulated meetings: lead time, misses and false alarms."""

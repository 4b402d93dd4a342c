"""Traces of a run, and what is computed from them: ground truth, latencies."""

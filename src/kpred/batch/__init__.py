"""Fitting very many scans: on this machine or on a cluster, resumed after any interruption."""

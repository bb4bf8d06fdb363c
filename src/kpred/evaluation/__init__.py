"""Evaluation: methods, metrics and the tables that hold what was measured."""

"""Tests what changed between conditions or sessions, stride by stride and with error bars."""

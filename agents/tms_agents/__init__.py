"""Processes on sensor hosts: device drivers with their emulators, agents, and a simulated room to run them in."""

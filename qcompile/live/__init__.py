"""Runs on real hardware: each job once, within a limit, and nothing that was paid for lost."""

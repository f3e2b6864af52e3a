"""OpenQASM output: compiled program files, and jobs of a policy's circuits."""

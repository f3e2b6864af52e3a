"""What leaves as OpenQASM: compiled program files, and jobs of a policy's circuits."""

"""Many runs: sweeps, diagrams, designs and the reproduction of the paper."""

"""What the three packages share: the grid file, its nodes, who sees whom, and what bonds are like."""

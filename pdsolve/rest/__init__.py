"""Bodies at rest: equilibria, load steps, paths and lives under cycles."""

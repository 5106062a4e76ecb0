"""Studies and the scripts beside them: ``mcsettle init --example`` writes the studies."""

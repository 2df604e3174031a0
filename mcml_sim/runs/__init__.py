"""Many batches, the same bits: stores, threads, clusters, and the two ways to simulate."""

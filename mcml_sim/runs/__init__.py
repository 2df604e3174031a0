"""Runs of many batches, with the same bits whoever traces them: stores, threads, clusters, two ways to simulate."""

"""Run on a cluster of two processes on this machine: python local_cluster.py."""

from distributed import LocalCluster

from mcml_sim import Grid, half_space, simulate

if __name__ == "__main__":  # worker processes import this file
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(**options) as workers:
        medium, grid = half_space(0.9, n=1.4), Grid(dr=0.1, nr=50)
        tally = simulate(medium, grid, 1_000_000, scheduler=workers.scheduler_address)
        print(tally.diffuse_reflectance)

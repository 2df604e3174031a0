#!/bin/bash
#SBATCH --job-name=photons
#SBATCH --ntasks=16
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=2G
#SBATCH --time=04:00:00
#SBATCH --requeue
# sbatch slurm.sh COMMAND ... runs the command once. It replaces @ with the address
# of a scheduler whose workers are the tasks of this job.
set -eu
port=$((20000 + ${SLURM_JOB_ID:-0} % 20000))
address=tcp://$(hostname):$port
export OMP_NUM_THREADS=1

dask scheduler --port "$port" --no-dashboard &
srun dask worker "$address" --nthreads 1 --no-dashboard --death-timeout 60 &
trap 'kill $(jobs -p)' EXIT

"${@//@/$address}"

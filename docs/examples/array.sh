#!/bin/bash
#SBATCH --job-name=shares
#SBATCH --array=0-15
#SBATCH --mem=2G
#SBATCH --time=04:00:00
#SBATCH --requeue
# Submit: sbatch array.sh. After all tasks: python share.py
set -eu
python share.py "$SLURM_ARRAY_TASK_ID" "$SLURM_ARRAY_TASK_COUNT"

#!/bin/bash
# A study as a SLURM array: 64 tasks, each with its own part, then one that closes the run.
#
#   sbatch --export=ALL,STUDY=study.toml,OUT=/shared/results docs/cluster/slurm.sh
#
# A task that fails, or runs into its time limit, is simply run again (--requeue does it by itself):
# what is finished is never computed twice. SIGTERM comes a minute before the limit.
#SBATCH --job-name=mcsettle
#SBATCH --array=1-64
#SBATCH --cpus-per-task=4
#SBATCH --mem=4G
#SBATCH --time=02:00:00
#SBATCH --signal=B:TERM@60
#SBATCH --requeue
#SBATCH --output=mcsettle-%A-%a.log
set -euo pipefail

: "${STUDY:?name the study file}" "${OUT:?name the folder of the results, on a shared drive}"
export OPENBLAS_NUM_THREADS=1
# Step A is read from here by every task; the kernels are compiled into a folder of each task's own.
export MCSETTLE_CACHE="${MCSETTLE_CACHE:-$OUT.cache}"
export MCSETTLE_KERNELS="${TMPDIR:-/tmp}/mcsettle-$SLURM_JOB_ID"
PARTS="${PARTS:-$SLURM_ARRAY_TASK_COUNT}"

# exec: SIGTERM reaches the program itself.
exec mcsettle run "$STUDY" --out "$OUT" \
    --shards "$SLURM_ARRAY_TASK_ID/$PARTS" --threads "$SLURM_CPUS_PER_TASK"

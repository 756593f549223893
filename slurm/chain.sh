#!/bin/bash
# Queue database, search and report, each to start once the one before has succeeded.
#
#   slurm/chain.sh
#   SCENE=fine DATABASE_OPTIONS="--ntasks=65 --time=4:00:00" slurm/chain.sh
#
# Where one fails, those behind it are cancelled; one that queues again is waited for.
#
# --- parameters: everything that may need a change, nothing below ---------------------------------
export SCENE=${SCENE:-paper}                     # further parameters: those of the three scripts
export DATABASE=${DATABASE:-${SCENE%.toml}.h5}
export COMPARISON=${COMPARISON:-comparison}
export REPORT=${REPORT:-report}
DATABASE_OPTIONS=${DATABASE_OPTIONS:-}           # of sbatch, for each of the three
SEARCH_OPTIONS=${SEARCH_OPTIONS:-}
REPORT_OPTIONS=${REPORT_OPTIONS:-}
# --------------------------------------------------------------------------------------------------

set -u
scripts=$(dirname "$0")
queued=()
queue() {
    local name=$1 script=$2 options job
    read -ra options <<< "$3"
    [ ${#queued[@]} = 0 ] || options+=("--dependency=afterok:${queued[-1]}")
    job=$(sbatch --parsable --kill-on-invalid-dep=yes "${options[@]}" "$scripts/$script") || {
        [ ${#queued[@]} = 0 ] || scancel "${queued[@]}"
        echo "nothing is queued: sbatch refuses the $name" >&2
        exit 1
    }
    queued+=("${job%%;*}")
    echo "$name: job ${queued[-1]}"
}
queue database generate.sbatch "$DATABASE_OPTIONS"
queue search tune.sbatch "$SEARCH_OPTIONS"
queue report bench.sbatch "$REPORT_OPTIONS"

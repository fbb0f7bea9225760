#!/bin/bash
# vrtm farm-template --slurm
# A bake as jobs of Slurm: an array of tasks that bake the frames, and a job after them that writes the files of all
# frames. `bash vrtm-bake.sh TASKS SCENE OPTION...` submits both jobs with the arguments of `vrtm bake` after TASKS. The
# same command again bakes the files that are missing.
#SBATCH --job-name=vrtm
#SBATCH --cpus-per-task=4
#SBATCH --mem=8G
#SBATCH --requeue
#SBATCH --open-mode=append

# How often a job begins again, perhaps on another machine, for want of a device or of memory.
restarts=3

# Submits the last job: after an array, and with the arguments of the bake.
after() {
    sbatch --parsable --begin="$1" --dependency="afterany:$2" "$0" last "${@:2}"
}

if [[ ${1-} =~ ^[1-9][0-9]*$ ]] && (($# > 1)); then
    array=$(sbatch --parsable --array="1-$1" "$0" task "$@") || exit
    array=${array%%;*}
    last=$(after now "$array" "${@:2}") || { scancel "$array" && exit 1; }
    echo "job $array: $1 tasks, job ${last%%;*}: the files of all frames"
    exit
fi
case ${1-} in
task) vrtm bake "${@:3}" --no-progress --task="$SLURM_ARRAY_TASK_ID/$2" ;;
last)
    # Slurm takes a task that begins again for one that has ended, and if no task may fail (afterok) drops this job.
    states=$(scontrol --oneliner show job "$2" 2>/dev/null)
    if [[ $states =~ JobState=(PENDING|RUNNING|SUSPENDED|COMPLETING) ]]; then
        after now+60 "${@:2}"
        exit
    elif [[ $states == *JobState=CANCELLED* ]]; then
        echo "a task was cancelled" >&2
        exit 1
    fi
    vrtm bake "${@:3}" --no-progress
    ;;
*)
    echo "usage: bash $0 TASKS SCENE OPTION..." >&2
    exit 2
    ;;
esac
code=$?
case $code in
# The last job says so of all frames.
3) [ "$1" != task ] || code=0 ;;
# 137: it was killed, as it is when memory is short. One task has the array's own number, which would mean all of them.
4 | 137)
    job=${SLURM_ARRAY_JOB_ID-$SLURM_JOB_ID}${SLURM_ARRAY_TASK_ID:+_$SLURM_ARRAY_TASK_ID}
    # Slurm ends this script as it begins the job again.
    ((${SLURM_RESTART_COUNT:-0} >= restarts)) || { scontrol requeue "$job" && sleep 600; }
    ;;
esac
exit "$code"

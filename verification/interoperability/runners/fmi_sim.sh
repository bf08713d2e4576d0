#!/bin/sh
# fmi-sim. Co-Simulation takes the inputs of each communication point, Model Exchange (forward Euler) their corners.
set -eu
parameters=$(tail -n +2 parameters.csv | sed 's/^/--init-values /; s/,/=/')
case $1 in
    cs) input=manoeuvre.csv interface=co-simulation interval=0.1 ;;
    me) input=jumps.csv interface=model-exchange interval=1e-4 ;;
esac
# shellcheck disable=SC2086
fmi-sim --model rov.fmu -i $input -o result.csv $interface -f 30 --output-interval $interval $parameters

#!/bin/sh
# fmu-manipulation-toolbox: the schema and the rules of the standard; it fails where there is an error.
set -eu
fmutool -input videoray.fmu -check

#!/bin/bash
# CPU time of each crate's compiler, for docs/reference/performance.md:
# seconds in user mode, in the kernel, and by the clock; crate; kind.
# RUSTC_WRAPPER=$PWD/docs/bench/rustc_time.sh RUSTC_TIMES=/tmp/times cargo build --release; sort -rn /tmp/times
exec 3>&2
name='' kind='' before=''
for word in "$@"; do
  case $before in
    --crate-name) name=$word ;;
    --crate-type) kind=$word ;;
  esac
  before=$word
done
TIMEFORMAT="%U %S %R $name $kind"
{ time "$@" 2>&3; } 2>>"${RUSTC_TIMES:?the file that the times are written to}"
